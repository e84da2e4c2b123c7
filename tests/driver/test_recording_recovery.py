"""Recovery: cut anywhere, damaged anywhere, a recording reads again in stock tools and loses only what was cut."""

from __future__ import annotations

import fcntl
from collections.abc import Callable, Iterator
from pathlib import Path

import numpy as np
import pytest
from mcap.exceptions import McapError
from mcap.reader import make_reader
from mcap.stream_reader import StreamReader
from mcap.writer import CompressionType
from mcap_ros2.writer import Writer as StockWriter

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.recording import RunWriter, read_recording, recover
from driver.recording import ros2_definitions as ros2
from driver.recording.mcap_records import whole_records
from service.reports.recording_list import summarise

CycleMaker = Callable[..., list[Cycle]]
Key = tuple[str, int, int, bytes]


def messages(path: Path) -> list[Key]:
    """(topic, sequence, log time, bytes) by the mcap library, with all checks on."""
    with path.open("rb") as stream:
        reader = make_reader(stream, validate_crcs=True)
        return [
            (c.topic, m.sequence, m.log_time, bytes(m.data))
            for _, c, m in reader.iter_messages(log_time_order=False)
        ]  # fmt: skip


def whole_chunks(path: Path) -> list[Key]:
    """What a streaming reader sees before it stumbles over the cut."""
    seen, channels = list[Key](), dict[int, str]()
    try:
        with path.open("rb") as stream:
            for record in StreamReader(stream, validate_crcs=True).records:
                if type(record).__name__ == "Channel":
                    channels[record.id] = record.topic  # type: ignore[attr-defined]
                elif type(record).__name__ == "Message":
                    m = record
                    seen.append((channels[m.channel_id], m.sequence, m.log_time, bytes(m.data)))  # type: ignore[attr-defined]
    except (McapError, ValueError, OSError, Exception) as error:
        assert not isinstance(error, AssertionError)
    return seen


@pytest.fixture(scope="module")
def whole(tmp_path_factory: pytest.TempPathFactory, dda: Installation, make_cycles: CycleMaker) -> Path:
    path = tmp_path_factory.mktemp("whole") / "run.mcap"
    writer = RunWriter(path, dda, {"mode": "csp"})
    for cycle in make_cycles(dda, 90)[::2]:
        writer.write(cycle)
    writer.finish()
    return path


def test_a_thousand_truncations_read_again(tmp_path: Path, whole: Path) -> None:
    data, everything = whole.read_bytes(), messages(whole)
    cut = tmp_path / "cut.mcap"
    rng = np.random.default_rng(11)
    kept_most = 0
    for number, size in enumerate(sorted(rng.integers(1, len(data), 1000).tolist())):
        cut.write_bytes(data[:size])
        before = whole_chunks(cut)
        try:
            report = recover(cut)
        except InputError as error:
            assert not before
            assert "whole record" in str(error) or "not an MCAP file" in str(error)
            assert cut.read_bytes() == data[:size], "what cannot be recovered is left as it is"
            continue
        got = messages(cut)
        assert got == everything[: len(got)]
        assert len(got) >= len(before)
        assert report.messages == len(got)
        assert not report.complete
        assert number % 20 or recover(cut).complete
        kept_most = max(kept_most, len(got))
    assert kept_most == len(everything)


def test_a_recovered_recording_keeps_what_it_was_made_with(tmp_path: Path, whole: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-15_000])
    with pytest.raises(InputError, match=r"cut\.mcap: is cut off: it has no end; run: etude recover"):
        read_recording(cut)
    recover(cut)
    recording, original = read_recording(cut), read_recording(whole)
    assert recording.installation == original.installation
    assert recording.metadata == original.metadata
    assert np.array_equal(recording.q, original.q[: len(recording.t)])


def test_a_complete_recording_is_left_untouched(tmp_path: Path, whole: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(whole.read_bytes())
    stamp = path.stat().st_mtime_ns
    report = recover(path)
    assert report.complete
    assert "nothing to recover" in report.sentence
    assert path.stat().st_mtime_ns == stamp


def test_the_original_may_be_kept(tmp_path: Path, whole: Path) -> None:
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole.read_bytes()[:-3])
    report = recover(cut, tmp_path / "new.mcap")
    assert messages(report.path) == messages(whole)
    assert len(cut.read_bytes()) == len(whole.read_bytes()) - 3
    assert sorted(p.name for p in tmp_path.iterdir()) == ["cut.mcap", "new.mcap"]


def check_nothing_is_lost_in_silence(path: Path, data: bytes, everything: set[Key]) -> None:
    """Recovered from these bytes, a file holds all messages, or its report says that it does not."""
    path.write_bytes(data)
    try:
        report = recover(path)
    except InputError:
        return
    whole_again = set(messages(path)) == everything
    assert whole_again or (not report.complete and (report.damaged or report.lost_bytes)), report


def test_a_flipped_byte_costs_its_chunk_and_is_said(tmp_path: Path, whole: Path) -> None:
    data, everything = whole.read_bytes(), set(messages(whole))
    for at in np.random.default_rng(5).integers(8, len(data), 400).tolist():
        flipped = data[:at] + bytes((data[at] ^ 0xFF,)) + data[at + 1 :]
        check_nothing_is_lost_in_silence(tmp_path / "damaged.mcap", flipped, everything)


def test_a_chunk_that_announces_more_than_it_holds_is_damaged(tmp_path: Path, whole: Path) -> None:
    """Its bytes fit their checksum; yet a reader that trusts the length asks for 2⁴⁸ bytes and more."""
    data = whole.read_bytes()
    with whole.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    first = summary.chunk_indexes[0]
    head = first.chunk_start_offset
    length = head + 9 + 28 + 4 + len(first.compression)
    assert int.from_bytes(data[length : length + 8], "little") == first.compressed_size
    damaged = tmp_path / "damaged.mcap"
    for at in (head + 1, head + 3, head + 8, *range(length, length + 8)):
        broken = bytearray(data)
        broken[at] ^= 0xFF
        damaged.write_bytes(broken)
        report = recover(damaged)
        assert not report.complete
        assert report.damaged
        assert set(messages(damaged)) <= set(messages(whole))
        assert recover(damaged).complete


def turned(whole: Path) -> Iterator[bytes]:
    """A recording with one byte turned in the head of a record, or in what follows it."""
    data = whole.read_bytes()
    heads = [place.start - 9 for place in whole_records(data, 8)]
    chosen = heads[:: len(heads) // 12] + heads[-3:]
    for at in sorted({at for head in chosen for at in range(head, min(head + 50, len(data)))}):
        for by in (0xFF, 0x01):
            yield data[:at] + bytes((data[at] ^ by,)) + data[at + 1 :]


def test_a_turned_byte_in_the_head_of_a_record_is_never_lost_in_silence(tmp_path: Path, whole: Path) -> None:
    everything = set(messages(whole))
    for data in turned(whole):
        check_nothing_is_lost_in_silence(tmp_path / "damaged.mcap", data, everything)


def test_a_turned_byte_is_read_or_named(tmp_path: Path, whole: Path) -> None:
    damaged, named = tmp_path / "damaged.mcap", 0
    for data in turned(whole):
        damaged.write_bytes(data)
        summarise(damaged)
        try:
            read_recording(damaged)
        except InputError as error:
            named += 1
            assert str(damaged) in str(error)
    assert named > 100


def test_smashed_bytes_cost_the_chunks_they_touch_and_no_other(
    tmp_path: Path, dda: Installation, make_cycles: CycleMaker
) -> None:
    """The heads of records are among them: reading begins again at the next chunk that is whole."""
    path = tmp_path / "run.mcap"
    writer = RunWriter(path, dda, {"mode": "csp"})
    for cycle in make_cycles(dda, 900):
        writer.write(cycle)
    writer.finish()
    everything = messages(path)
    with path.open("rb") as stream:
        summary = make_reader(stream).get_summary()
    assert summary is not None
    chunks = summary.chunk_indexes
    assert len(chunks) > 6
    data = bytearray(path.read_bytes())
    second, third = chunks[1], chunks[2]
    first, last = second.chunk_start_offset + second.chunk_length // 2, third.chunk_start_offset + 20
    data[first:last] = bytes(b ^ 0x5A for b in data[first:last])
    path.write_bytes(data)
    report = recover(path)
    begin, end = second.message_start_time, third.message_end_time
    assert messages(path) == [m for m in everything if not begin <= m[2] <= end]
    assert report.lost_bytes == 0
    assert report.damaged
    assert "nothing recorded was lost" not in report.sentence
    assert len(read_recording(path).gaps) == 1


@pytest.mark.parametrize("compression", list(CompressionType))
@pytest.mark.parametrize("chunk_size", [600, 100_000])
def test_files_of_other_writers_recover_too(tmp_path: Path, compression: CompressionType, chunk_size: int) -> None:
    path = tmp_path / "bag.mcap"
    with path.open("wb") as stream:
        writer = StockWriter(stream, chunk_size, compression)
        schema = writer.register_msgdef(ros2.JOINT_STATE, ros2.DEFINITIONS[ros2.JOINT_STATE])
        for k in range(200):
            stamp = {"sec": 1, "nanosec": k * 1_000_000}
            message = {
                "header": {"stamp": stamp, "frame_id": "base"}, "name": ["a", "b"],
                "position": [float(k), 2.0], "velocity": [], "effort": [1.0, 2.0],
            }  # fmt: skip
            writer.write_message("/joint_states", schema, message, 10**9 + k * 1_000_000)
        writer.finish()
    data, everything = path.read_bytes(), messages(path)
    for share in (0.3, 0.6, 0.95):
        path.write_bytes(data[: int(len(data) * share)])
        before = whole_chunks(path)
        recover(path)
        got = messages(path)
        assert got == everything[: len(got)]
        assert len(got) >= len(before)
        if compression is CompressionType.NONE and share < 0.9:
            assert len(got) > 10, "whole messages of the chunk that was cut are kept"


def test_a_file_being_written_is_left_alone(tmp_path: Path, whole: Path) -> None:
    path = tmp_path / "run.mcap"
    path.write_bytes(whole.read_bytes()[:-100])
    with path.open("rb") as stream:
        fcntl.flock(stream.fileno(), fcntl.LOCK_EX)
        with pytest.raises(InputError, match="being written at this moment"):
            recover(path)


@pytest.mark.parametrize("content", [b"", b"hello world, this is text", b"\x89MCAP0\r\n", b"\x89MCAP0\r\n\x01\x09"])
def test_what_holds_nothing_is_said_so(tmp_path: Path, content: bytes) -> None:
    path = tmp_path / "x.mcap"
    path.write_bytes(content)
    with pytest.raises(InputError, match=r"not an MCAP file|hold no whole record"):
        recover(path)
    with pytest.raises(InputError, match=r"is empty|not an MCAP file|is cut off"):
        read_recording(path)
