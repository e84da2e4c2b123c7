"""Recordings: what stock readers see, what our reader gives back, what a killed process loses."""

from __future__ import annotations

import errno
import math
from collections.abc import Callable
from dataclasses import replace
from io import BytesIO
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st
from mcap.exceptions import EndOfFile
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap_ros2.decoder import DecoderFactory
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from driver.cyclic.cycle import Cycle, LoopState
from driver.recording import RunWriter, read_recording, recover
from driver.recording import ros2_definitions as ros2
from driver.recording.message_records import (
    RECORD_HEAD_BYTES,
    BytesRecord,
    CanFrameRecord,
    JointStateRecord,
    LogRecord,
    WrenchRecord,
)

CycleMaker = Callable[..., list[Cycle]]


def write(path: Path, installation: Installation, cycles: list[Cycle], **metadata: str) -> Path:
    writer = RunWriter(path, installation, metadata)
    for cycle in cycles:
        writer.write(cycle)
    writer.finish()
    return path


def stock_messages(path: Path) -> list[tuple[str, int, int, Any]]:
    """(topic, sequence, log time, message) by mcap and mcap_ros2, checksums verified."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True, decoder_factories=[DecoderFactory()])
        return [
            (channel.topic, message.sequence, message.log_time, decoded)
            for _, channel, message, decoded in reader.iter_decoded_messages(log_time_order=False)
        ]


def same(a: Any, b: Any) -> bool:
    return bool(np.array_equal(np.asarray(a), np.asarray(b), equal_nan=True))


def test_stock_readers_see_every_number(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 120, lost_share=0.05)
    path = write(tmp_path / "run.mcap", dda, cycles)
    messages = stock_messages(path)
    by_topic: dict[str, list[tuple[int, int, Any]]] = {}
    for topic, sequence, log_ns, message in messages:
        by_topic.setdefault(topic, []).append((sequence, log_ns, message))
    for topic, wanted in (
        ("/joint_states", ("q", "dq", "tau")),
        ("/command", ("q_d", "dq_d", "tau_command")),
        ("/feedforward", (None, None, "tau_ff")),
    ):
        assert len(by_topic[topic]) == len(cycles)
        for (sequence, log_ns, message), cycle in zip(by_topic[topic], cycles, strict=True):
            assert (sequence, log_ns) == (cycle.index, cycle.time_ns)
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == cycle.time_ns
            assert message.name == list(dda.joint_names)
            for values, name in zip((message.position, message.velocity, message.effort), wanted, strict=True):
                assert same(values, getattr(cycle, name) if name else [])
    for bus in dda.bus:
        number = dda.bus.index(bus)
        sent = [frame for cycle in cycles for frame in cycle.frames if frame.bus == number]
        for (_, _, message), frame in zip(by_topic[f"/can/{bus.name}"], sent, strict=True):
            assert message.header.frame_id == ("tx" if frame.sent else "rx")
            assert message.header.stamp.sec * 10**9 + message.header.stamp.nanosec == frame.time_ns
            assert message.id == int.from_bytes(frame.data[:4], "little")
            assert (message.dlc, bytes(message.data)) == (frame.data[4], frame.data[8:])
    line = b"".join(bytes(message.data) for _, _, message in by_topic["/serial/wrist"])
    assert line == b"".join(data for cycle in cycles for _, data in cycle.serial)
    assert [message.msg for _, _, message in by_topic["/events"]] == [e for c in cycles for e in c.events]


def test_wrench_has_every_sample_of_the_sensor(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    path = write(tmp_path / "run.mcap", dda, make_cycles(dda, 60))
    wrenches = [message for topic, _, _, message in stock_messages(path) if topic == "/wrench"]
    assert len(wrenches) >= 58
    assert {message.header.frame_id for message in wrenches} == {"tool"}
    force = np.array([[m.wrench.force.x, m.wrench.force.y, m.wrench.force.z] for m in wrenches])
    assert np.isnan(force[0]).all(), "the first frame only starts the sensor's clock"
    assert np.isfinite(force[1:]).all()


def test_strict_and_streaming_readers_accept_the_file(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker
) -> None:
    path = write(tmp_path / "run.mcap", dda, make_cycles(dda, 50), mode="csp")
    with path.open("rb") as stream:
        records = list(StreamReader(stream, validate_crcs=True).records)
        stream.seek(0)
        reader = make_reader(stream, validate_crcs=True)
        summary = reader.get_summary()
        assert reader.get_header().profile == "ros2"
        assert {a.name for a in reader.iter_attachments()} == {"installation.toml", "installation.json", "dda.urdf"}
        assert [m.metadata for m in reader.iter_metadata()] == [{"arm": "dda", "mode": "csp"}]
    assert summary is not None
    assert summary.statistics is not None
    counted = dict.fromkeys(summary.channels, 0)
    for record in records:
        if type(record).__name__ == "Message":
            counted[record.channel_id] += 1  # type: ignore[attr-defined]
    assert {k: n for k, n in counted.items() if n} == summary.statistics.channel_message_counts
    assert len(stock_messages(path)) == summary.statistics.message_count


def test_reading_back_gives_the_same_numbers(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 300, lost_share=0.03, seed=4)
    recording = read_recording(write(tmp_path / "run.mcap", dda, cycles, motion="identify-1"))
    assert recording.joints == dda.joint_names
    assert recording.arm == "dda"
    assert recording.metadata["motion"] == "identify-1"
    assert recording.start_ns == cycles[0].time_ns
    assert recording.t == pytest.approx(np.arange(300) * 1e-3, abs=1e-12)
    for name in ("q", "dq", "tau", "q_d", "dq_d", "tau_command", "tau_ff"):
        assert same(getattr(recording, name), [getattr(cycle, name) for cycle in cycles]), name
    assert np.isnan(recording.q).any()
    assert [event.text for event in recording.events] == [e for c in cycles for e in c.events]
    assert recording.events[1].t == pytest.approx(0.05)
    assert recording.installation is not None
    assert recording.installation.joint == dda.joint
    assert recording.installation.drives.keys() == dda.drives.keys()
    assert recording.wrench is not None
    assert recording.wrench_t is not None
    assert recording.wrench_frame == "tool"
    assert len(recording.wrench) == len(recording.wrench_t) >= 298


def test_equal_cycles_give_equal_bytes(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    first = write(tmp_path / "a.mcap", dda, make_cycles(dda, 200)).read_bytes()
    second = write(tmp_path / "b.mcap", dda, make_cycles(dda, 200)).read_bytes()
    assert first == second
    assert write(tmp_path / "c.mcap", dda, make_cycles(dda, 200, seed=1)).read_bytes() != first


def test_lost_cycles_show_as_a_gap(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 200)
    recording = read_recording(write(tmp_path / "run.mcap", dda, cycles[:100] + cycles[150:]))
    (gap,) = recording.gaps
    assert (gap.after, gap.duration) == (99, pytest.approx(0.051))
    assert recording.segments == (slice(0, 100), slice(100, 150))
    assert recording.notes == ("1 gap, together 0.051 s: the longest 0.051 s, at t = 0.099 s",)


def test_what_is_on_disk_is_less_than_100_ms_behind(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    """The file as a killed process leaves it at any cycle: chunks reach the disk as the run goes on."""
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, dda, {})
    newest = 0
    for cycle in make_cycles(dda, 500):
        writer.write(cycle)
        if cycle.index % 37 == 5:
            with path.open("rb") as stream:
                records, times = StreamReader(stream).records, list[int]()
                with pytest.raises(EndOfFile):
                    times.extend(getattr(record, "log_time", 0) for record in records)
            newest = max(times)
            assert cycle.time_ns - newest < 100_000_000 or cycle.index < 100
    assert newest
    writer.abandon()


def test_a_stop_is_an_error_in_the_events(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 3)
    cycles[1] = replace(cycles[1], state=LoopState.LATCHED, events=("joint2: over-current",))
    recording = read_recording(write(tmp_path / "run.mcap", dda, cycles))
    assert [(e.level, e.text) for e in recording.events if "joint2" in e.text] == [(40, "joint2: over-current")]


def test_a_full_disk_leaves_a_file_that_ends_with_a_whole_record(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker, monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = make_cycles(dda, 400)
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, dda, {})
    stream = writer._stream

    class FullAfter:
        room = 60_000

        def write(self, data: memoryview) -> int:
            taken = stream.write(data[: min(len(data), self.room)]) or 0
            self.room -= taken
            if not taken:
                raise OSError(errno.ENOSPC, "No space left on device")
            return taken

        def __getattr__(self, name: str) -> Any:
            return getattr(stream, name)

    monkeypatch.setattr(writer._file, "_stream", FullAfter())
    with pytest.raises(OSError, match="No space left"):
        for cycle in cycles:
            writer.write(cycle)
    writer.abandon()
    assert path.stat().st_size < 60_000
    report = recover(path)
    assert report.lost_bytes == 0
    assert 0 < len(read_recording(path).t) < 400


def test_nothing_is_overwritten(tmp_path: Path, dda: Installation) -> None:
    path = tmp_path / "run.mcap"
    path.write_text("precious")
    with pytest.raises(InputError, match=r"run\.mcap: is already there"):
        RunWriter(path, dda, {})
    assert path.read_text() == "precious"


numbers = st.floats(width=64, allow_nan=True)


@given(
    names=st.lists(st.text(min_size=0, max_size=9), min_size=1, max_size=8),
    fields=st.tuples(st.booleans(), st.booleans(), st.booleans()),
    stamp_ns=st.integers(0, 2**31 * 10**9 - 1),
    data=st.data(),
)
@settings(max_examples=150, deadline=None)
def test_joint_states_are_what_the_stock_writer_writes(
    names: list[str], fields: tuple[bool, bool, bool], stamp_ns: int, data: st.DataObject
) -> None:
    """Byte for byte the CDR of mcap_ros2, whatever the names' lengths do to the alignment."""
    columns = [data.draw(st.lists(numbers, min_size=len(names), max_size=len(names))) for on in fields if on]
    record = JointStateRecord(3, names, fields).pack(7, stamp_ns, stamp_ns, *columns)
    filled = iter(columns)
    position, velocity, effort = (next(filled) if on else [] for on in fields)
    header = {"stamp": {"sec": stamp_ns // 10**9, "nanosec": stamp_ns % 10**9}, "frame_id": ""}
    message = {"header": header, "name": names, "position": position, "velocity": velocity, "effort": effort}
    assert record[RECORD_HEAD_BYTES:] == stock_cdr(ros2.JOINT_STATE, message)
    assert int.from_bytes(record[1:9], "little") == len(record) - 9


@given(frame=st.text(max_size=12), values=st.lists(st.floats(), min_size=6, max_size=6))
@settings(max_examples=60, deadline=None)
def test_wrenches_are_what_the_stock_writer_writes(frame: str, values: list[float]) -> None:
    record = WrenchRecord(1, frame).pack(0, 5, 5, values)
    names = ("x", "y", "z")
    wrench = {"force": dict(zip(names, values[:3], strict=True)), "torque": dict(zip(names, values[3:], strict=True))}
    message = {"header": {"stamp": {"sec": 0, "nanosec": 5}, "frame_id": frame}, "wrench": wrench}
    assert record[RECORD_HEAD_BYTES:] == stock_cdr(ros2.WRENCH_STAMPED, message)


@given(
    sent=st.booleans(), word=st.integers(0, 2**32 - 1), length=st.integers(0, 8), data=st.binary(min_size=8, max_size=8)
)
@settings(max_examples=100, deadline=None)
def test_can_frames_come_back_bit_by_bit(sent: bool, word: int, length: int, data: bytes) -> None:
    frame = word.to_bytes(4, "little") + bytes((length, 0, 0, 0)) + data
    channel = CanFrameRecord(9)
    record = channel.pack(channel.head(1, 10, 11, sent), frame)
    assert int.from_bytes(record[1:9], "little") == len(record) - 9
    assert CanFrameRecord.unpack(record[RECORD_HEAD_BYTES:]) == (sent, 11, frame)
    message = {
        "header": {"stamp": {"sec": 0, "nanosec": 11}, "frame_id": "tx" if sent else "rx"},
        "id": word & 0x1FFF_FFFF,
        "is_rtr": bool(word >> 30 & 1),
        "is_extended": bool(word >> 31),
        "is_error": bool(word >> 29 & 1),
        "dlc": length,
        "data": list(data),
    }
    assert record[RECORD_HEAD_BYTES:] == stock_cdr(ros2.CAN_FRAME, message)


@given(text=st.text(max_size=40), data=st.binary(max_size=60), level=st.sampled_from([20, 30, 40]))
@settings(max_examples=60, deadline=None)
def test_sentences_and_bytes_come_back(text: str, data: bytes, level: int) -> None:
    log = LogRecord(1, "arm").pack(0, 5, level, text)[RECORD_HEAD_BYTES:]
    assert LogRecord.unpack(log) == (level, text)
    stamp = {"sec": 0, "nanosec": 5}
    message = {"stamp": stamp, "level": level, "name": "arm", "msg": text, "file": "", "function": "", "line": 0}
    assert log == stock_cdr(ros2.LOG, message)
    raw = BytesRecord(1).pack(0, 5, data)[RECORD_HEAD_BYTES:]
    assert BytesRecord.unpack(raw) == data
    assert raw == stock_cdr(ros2.BYTES, {"layout": {"dim": [], "data_offset": 0}, "data": list(data)})


def stock_cdr(kind: str, message: dict[str, Any]) -> bytes:
    """The body as mcap_ros2 encodes it."""
    stream = BytesIO()
    writer = StockWriter(stream)
    writer.write_message("/x", writer.register_msgdef(kind, ros2.DEFINITIONS[kind]), message, 0)
    writer.finish()
    stream.seek(0)
    ((_, _, stored),) = make_reader(stream).iter_messages()
    return bytes(stored.data)


def test_missing_values_are_nan_and_not_zero(tmp_path: Path, dda: Installation, make_cycles: CycleMaker) -> None:
    cycles = make_cycles(dda, 20, lost_share=1.0)
    recording = read_recording(write(tmp_path / "run.mcap", dda, cycles))
    assert np.isnan(recording.q).all()
    assert all(math.isnan(v) for v in cycles[3].q)
