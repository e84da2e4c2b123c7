"""Replay: the raw channels give the decoded ones again, byte for byte, and a difference is found."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import pytest
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.recording import RunWriter, replay
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
