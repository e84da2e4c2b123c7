"""Temperatures of the motors: from the winding through TPDO and file to columns; and those of foreign files."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from mcap.reader import make_reader
from mcap.writer import Writer as PlainWriter
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from config.schema import VirtualHardware
from driver.arm import ArmLoop
from driver.bus.frames import pack
from driver.cyclic.cycle import Cycle, RawFrame
from driver.recording import RecorderProcess, RunWriter, read_recording, replay
from driver.recording import ros2_definitions as ros2
from driver.recording.csv_recording import read_csv, write_csv
from driver.recording.message_records import RECORD_HEAD_BYTES, JointStateRecord, TemperatureRecord

WARM = """
description = "Two motors that have run: the first cools quickly, the second holds its warmth"

[[motor]]
joint = "joint1"
thermal = { capacity_j_k = 2.0, resistance_k_w = 1.0, loss_w_nm2 = 0.0, ambient_c = 20.0, initial_c = 80.0 }

[[motor]]
joint = "joint2"
thermal = { capacity_j_k = 1e6, resistance_k_w = 1.0, loss_w_nm2 = 0.0, ambient_c = 20.0, initial_c = -12.3 }
"""


@pytest.fixture(scope="module")
def of_the_standin(
    tmp_path_factory: pytest.TempPathFactory, dda: Installation, stand_in: Callable[..., AbstractContextManager[int]]
) -> Path:
    """A recording of four seconds at rest, of motors as `WARM` says."""
    directory = tmp_path_factory.mktemp("warm")
    hidden = directory / "warm.toml"
    hidden.write_text(WARM)
    arm = dda.model_copy(update={"virtual": VirtualHardware(hidden=str(hidden))})
    with pytest.MonkeyPatch.context() as patch, stand_in(arm, directory):
        patch.setenv("ETUDE_RUN", str(directory))
        with (
            ArmLoop.start(arm, lockstep=True, ring_name="warm") as loop,
            RecorderProcess.start(arm, "warm", directory) as recorder,
        ):
            recorder.start_run("rest", metadata={"mode": "csp"})
            loop.run_for(4.0)
            return recorder.stop_run()


def test_the_drives_tell_how_warm_their_motors_are(of_the_standin: Path) -> None:
    recording = read_recording(of_the_standin)
    assert recording.temperature is not None
    first, second, third = recording.temperature.T
    assert second == pytest.approx(-12.3, abs=0.06)
    assert third == pytest.approx(22.0)
    early, late = np.searchsorted(recording.t, [1.0, 3.0])
    fallen = (first[late] - 20.0) / (first[early] - 20.0)
    assert fallen == pytest.approx(np.exp(-2.0 / 2.0), rel=0.02), "2 J/K through 1 K/W: a time constant of 2 s"


def test_replay_and_a_stock_reader_agree(of_the_standin: Path) -> None:
    report = replay(of_the_standin)
    assert report.identical, report.sentence
    assert report.messages["/temperature/joint1"] in (16, 17), "at each 240th of 4000 SYNCs"
    with of_the_standin.open("rb") as stream:
        reader = make_reader(stream, decoder_factories=[DecoderFactory()])
        told = [m for *_, m in reader.iter_decoded_messages(topics=["/temperature/joint2"])]
    assert {message.header.frame_id for message in told} == {"joint2"}
    assert [message.temperature for message in told] == pytest.approx([-12.3] * len(told), abs=0.06)


def test_a_csv_holds_them_too(of_the_standin: Path, tmp_path: Path) -> None:
    at_rest = read_recording(of_the_standin)
    recording = replace(at_rest, wrench=None, wrench_t=None)  # without noise it stands still, and is no sample
    write_csv(recording, tmp_path / "rest.csv")
    again = read_csv(tmp_path / "rest.csv").temperature
    assert again is not None
    assert recording.temperature is not None
    assert again[-1] == pytest.approx(recording.temperature[-1])


def told_of_a_motor(path: Path, cut: int) -> Path:
    """A bag of joint ``hip`` with temperatures of a frame that is no joint, one message without its last bytes."""
    with path.open("wb") as stream:
        writer = PlainWriter(stream)
        writer.start("ros2")
        states, warmth = (
            writer.register_channel(topic, "cdr", writer.register_schema(kind, "ros2msg", b""))
            for topic, kind in (("/joint_states", ros2.JOINT_STATE), ("/warmth", ros2.TEMPERATURE))
        )
        state = JointStateRecord(states, ["hip"], (True, False, False))
        motor = TemperatureRecord(warmth, "motor_a")
        for k in range(20):
            at = 10_000_000 * (k + 1)
            writer.add_message(states, at, state.pack(k, at, at, [0.1])[RECORD_HEAD_BYTES:], at)
            told = motor.pack(k, at, at, 30.0)[RECORD_HEAD_BYTES:]
            writer.add_message(warmth, at, told[: len(told) - cut] if k == 7 else told, at)
        writer.finish()
    return path


def test_temperatures_of_no_joint_are_left_out_and_said(tmp_path: Path) -> None:
    recording = read_recording(told_of_a_motor(tmp_path / "bag.mcap", 0))
    assert recording.temperature is None
    assert any("told of motor_a, which are no joints" in note for note in recording.notes)


def test_a_temperature_that_is_cut_off_is_one_sentence(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"/warmth: a message is no sensor_msgs/msg/Temperature: it has \d+ bytes"):
        read_recording(told_of_a_motor(tmp_path / "bag.mcap", 25))


def test_a_drive_without_thermometer_is_left_out_and_said(
    tmp_path: Path, dda: Installation, make_cycles: Callable[..., list[Cycle]]
) -> None:
    """It tells the end of its range, 3276.7 °C."""
    told = {0x481: 251, 0x482: 0x7FFF}
    writer = RunWriter(tmp_path / "run.mcap", dda, {"mode": "csp"})
    for cycle in make_cycles(dda, 30):
        kept = [f for f in cycle.frames if not 0x481 <= int.from_bytes(f.data[:4], "little") <= 0x483]
        own = [
            RawFrame(bus, cycle.time_ns, False, pack(can_id, counts.to_bytes(2, "little")))
            for bus, (can_id, counts) in enumerate(told.items())
        ]
        writer.write(replace(cycle, frames=(*kept, *own)))
    writer.finish()
    recording = read_recording(tmp_path / "run.mcap")
    assert recording.temperature is not None
    assert recording.temperature[:, 0] == pytest.approx(25.1)
    assert np.isnan(recording.temperature[:, 1:]).all()
    (note,) = recording.notes
    assert note == ("the temperature of joint2 is left out: its drive tells 3277 °C, as one without a thermometer")


@pytest.mark.parametrize("topics", [("/temperature", "/temperature"), ("/a/warmth", "/b/warmth")])
def test_foreign_temperatures_are_taken_by_the_joint_in_their_frame(tmp_path: Path, topics: tuple[str, str]) -> None:
    """One topic of all joints or a topic each; a sample that is none, and a frame that is no joint, are passed over."""
    path = tmp_path / "bag.mcap"
    with path.open("wb") as stream:
        writer = StockWriter(stream)
        states = writer.register_msgdef(ros2.JOINT_STATE, ros2.DEFINITIONS[ros2.JOINT_STATE])
        warmth = writer.register_msgdef(ros2.TEMPERATURE, ros2.DEFINITIONS[ros2.TEMPERATURE])
        for k in range(101):
            stamp = {"sec": 7, "nanosec": k * 10_000_000 % 1_000_000_000} if k < 100 else {"sec": 8, "nanosec": 0}
            q = {"name": ["hip", "toe", "rib"], "position": [0.1, 0.2, 0.3], "velocity": [], "effort": []}
            writer.write_message("/joint_states", states, {"header": {"stamp": stamp, "frame_id": ""}, **q}, k)
            if k % 50 == 0:
                for topic, frame, celsius in zip(
                    (*topics, "/imu"), ("hip", "toe", "imu"), (20.0 + k, np.nan if k == 50 else 40.0, 99.0), strict=True
                ):
                    header = {"stamp": stamp, "frame_id": frame}
                    writer.write_message(topic, warmth, {"header": header, "temperature": celsius, "variance": 0.0}, k)
        writer.finish()
    temperature = read_recording(path).temperature
    assert temperature is not None
    assert temperature[[0, 25, 100], 0] == pytest.approx([20.0, 45.0, 120.0])
    assert temperature[:, 1] == pytest.approx(40.0)
    assert np.isnan(temperature[:, 2]).all()
