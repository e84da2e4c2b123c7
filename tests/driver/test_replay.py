"""Replay: the raw channels give the decoded ones again, byte for byte, and a difference is found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.recording import RunWriter, read_recording, replay
from driver.recording import ros2_definitions as ros2

CycleMaker = Callable[..., list[Cycle]]


def write(path: Path, installation: Installation, cycles: list[Cycle], **metadata: str) -> Path:
    writer = RunWriter(path, installation, metadata)
    for cycle in cycles:
        writer.write(cycle)
    writer.finish()
    return path


@pytest.mark.parametrize(("lost", "late"), [(0.0, 0.0), (0.1, 0.0), (0.05, 0.1)])
def test_the_raw_channels_give_the_decoded_ones_again(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, lost: float, late: float
) -> None:
    """Also with feedback that was lost, or came too late and must not count for the next cycle."""
    cycles = make_cycles(dda, 400, lost_share=lost, late_share=late)
    report = replay(write(tmp_path / "run.mcap", dda, cycles, mode="csp"))
    assert report.identical, report.differences
    assert report.messages["/joint_states"] == 400
    assert report.messages["/wrench"] >= 398
    assert "byte for byte" in report.sentence


def test_any_altered_measurement_is_found(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 50)
    q = cycles[17].q
    cycles[17] = replace(cycles[17], q=(math.nextafter(q[0], math.inf), *q[1:]))
    report = replay(write(tmp_path / "run.mcap", dda, cycles, mode="csp"))
    assert not report.identical
    assert (report.differences[0].topic, report.differences[0].message) == ("/joint_states", 18)
    assert "differs from its raw channel, first in message 18" in report.sentence


def test_a_lost_raw_frame_is_found(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 50)
    cycles[8] = replace(cycles[8], frames=tuple(f for f in cycles[8].frames if f.sent))
    report = replay(write(tmp_path / "run.mcap", dda, cycles, mode="csp"))
    assert [d.message for d in report.differences] == [9]


def test_foreign_recordings_cannot_be_replayed(tmp_path: Path) -> None:
    path = tmp_path / "bag.mcap"
    with path.open("wb") as stream:
        writer = StockWriter(stream)
        writer.register_msgdef(ros2.JOINT_STATE, ros2.DEFINITIONS[ros2.JOINT_STATE])
        writer.finish()
    with pytest.raises(InputError, match="does not carry the installation"):
        replay(path)


def test_a_mode_that_the_installation_lacks_is_named(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker
) -> None:
    path = write(tmp_path / "run.mcap", dda, make_cycles(dda, 3), mode="pvt")
    with pytest.raises(InputError, match="made in mode 'pvt'"):
        replay(path)


def test_cycles_before_the_run_warm_the_decoders_up(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    """Drives without velocity object, and the sensor's clock, need the cycle before, which is not itself decoded."""
    drives = {
        name: drive.model_copy(
            update={
                "layouts": {
                    mode: layout.model_copy(update={"tpdo": layout.tpdo[:1]}) for mode, layout in drive.layouts.items()
                }
            }
        )
        for name, drive in dda.drives.items()
    }
    encoders_only = dda.model_copy(update={"drives": drives})
    cycles = make_cycles(encoders_only, 60, lost_share=0.05)
    assert any(cycle.valid[0] and not math.isnan(cycle.dq[0]) for cycle in cycles[20:])
    writer = RunWriter(tmp_path / "run.mcap", encoders_only, {"mode": "csp"})
    for cycle in cycles[:20]:
        writer.warm_up(cycle)
    for cycle in cycles[20:]:
        writer.write(cycle)
    writer.finish()
    report = replay(tmp_path / "run.mcap")
    assert report.identical, report.differences
    assert report.messages["/joint_states"] == 40
    recording = read_recording(tmp_path / "run.mcap")
    assert recording.start_ns == cycles[20].time_ns
    assert recording.wrench is not None
    assert not np.isnan(recording.wrench).any()
    cold = write(tmp_path / "cold.mcap", encoders_only, cycles[20:], mode="csp")
    assert replay(cold).differences[0].message == 1, "without the cycles before, the first velocity cannot come again"
