"""Makes a recording that was cut off, or damaged, readable by stock tools again."""

from __future__ import annotations

import fcntl
import mmap
import os
import zlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import BinaryIO

from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, DataEnd, Header, MessageIndex, Metadata, Schema
from mcap.writer import MCAP0_MAGIC

from config import InputError
from driver.recording.chunked_file import INDEX_HEAD, ChunkedFile
from driver.recording.mcap_records import (
    HEAD,
    UNREADABLE,
    RecordPlace,
    chunk_data,
    is_complete,
    is_mcap,
    message_offsets,
    next_chunk,
    parse,
    partial_chunk_data,
    whole_records,
)

Data = memoryview
_MADE_ANEW: dict[int, type] = {
    Opcode.HEADER: Header,
    Opcode.DATA_END: DataEnd,
    Opcode.MESSAGE_INDEX: MessageIndex,
}


@dataclass(frozen=True)
class RecoveryReport:
    """What became of a recording. ``complete``: it was whole already and is untouched."""

    path: Path
    complete: bool
    messages: int
    seconds: float
    """From the first to the last message kept."""
    lost_bytes: int
    """Bytes of the file that belong to no record kept."""
    damaged: tuple[str, ...]
    """What was left out between intact parts, one sentence each."""

    @property
    def sentence(self) -> str:
        if self.complete:
            return f"{self.path} is complete: {self.messages} messages over {self.seconds:.3f} s, nothing to recover"
        kept = f"{self.path}: kept {self.messages} messages over {self.seconds:.3f} s"
        lost = f", lost {self.lost_bytes} bytes at its end" if self.lost_bytes else ""
        if not self.lost_bytes and not self.damaged:
            lost = ", nothing recorded was lost"
        return kept + lost + "".join(f"; {sentence}" for sentence in self.damaged)


def recover(path: Path | str, output: Path | str | None = None) -> RecoveryReport:
    """Give a truncated file its end: every whole message is kept, the summary is written anew.

    The result takes the file's place in one step, or goes to ``output``; attachments and metadata stay.
    Raises InputError when the file is no MCAP file, holds nothing whole, or is being written.
    """
    path = Path(path)
    try:
        stream = path.open("rb")
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "check the path") from None
    with stream:
        try:
            fcntl.flock(stream.fileno(), fcntl.LOCK_SH | fcntl.LOCK_NB)
        except BlockingIOError:
            raise InputError(str(path), "is being written at this moment", "stop the run first") from None
        if not is_mcap(stream.read(8)):
            raise InputError(str(path), "is not an MCAP file", "name a recording")
        with mmap.mmap(stream.fileno(), 0, prot=mmap.PROT_READ) as mapped, memoryview(mapped) as data:
            if output is None and (report := _already_complete(path, stream, data)):
                return report
            return _rebuild(path, Path(output or path), data)


def _already_complete(path: Path, stream: BinaryIO, data: Data) -> RecoveryReport | None:
    """A report when the file reads without fault from end to end, else None."""
    if not is_complete(data):
        return None
    stream.seek(0)
    try:
        summary = SeekingReader(stream).get_summary()
        if summary is None or summary.statistics is None or not _summary_is_intact(data):
            return None
        for index in summary.chunk_indexes:
            start = index.chunk_start_offset
            if HEAD.unpack_from(data, start) != (Opcode.CHUNK, index.chunk_length - HEAD.size):
                return None
            chunk_data(parse(Chunk, data[start + HEAD.size : start + index.chunk_length]))
    except UNREADABLE:
        return None
    statistics = summary.statistics
    seconds = (statistics.message_end_time - statistics.message_start_time) / 1e9
    return RecoveryReport(path, True, statistics.message_count, seconds, 0, ())


def _summary_is_intact(data: Data) -> bool:
    """Does the footer's checksum fit? It covers the summary and the footer up to itself; 0 says that there is none."""
    end = len(data) - len(MCAP0_MAGIC) - 4
    summary_start = int.from_bytes(data[end - 16 : end - 8], "little")
    checksum = int.from_bytes(data[end : end + 4], "little")
    return checksum in (0, zlib.crc32(data[summary_start:end]))


def _rebuild(path: Path, output: Path, data: Data) -> RecoveryReport:
    records = whole_records(data, 8)
    header = next(records, None)
    if header is None or header.opcode != Opcode.HEADER:
        raise InputError(str(path), f"its {len(data)} bytes hold no whole record", "there is nothing to recover")
    partial = output.with_name(f".{output.name}.recovering")
    try:
        with partial.open("wb", buffering=0) as file:
            first = parse(Header, data[header.start : header.end])
            rebuilt = _Rebuilt(ChunkedFile(file, first.profile, first.library))
            end = rebuilt.copy(data, records, header.end)
            rebuilt.file.finish()
            os.fsync(file.fileno())
        partial.replace(output)
    except OSError as error:
        partial.unlink(missing_ok=True)
        raise InputError(
            str(output), f"cannot be written ({error.strerror})", "free some space, or name another --out"
        ) from None
    return RecoveryReport(output, False, rebuilt.file.messages, rebuilt.file.seconds, len(data) - end, rebuilt.damaged)


class _Rebuilt:
    """A new file that takes over what is whole in an old one."""

    def __init__(self, file: ChunkedFile) -> None:
        self.file = file
        self._damaged: list[str] = []
        self._orphans = 0
        self._channels: set[int] = set()
        self._schemas: set[int] = set()

    @property
    def damaged(self) -> tuple[str, ...]:
        """What could not be taken over, one sentence each."""
        orphans = f"{self._orphans} messages belong to no channel that is left"
        return (*self._damaged, orphans) if self._orphans else tuple(self._damaged)

    def copy(self, data: Data, records: Iterator[RecordPlace], end: int) -> int:
        """Take over the records of the data section; returns where the last byte that was kept ends."""
        while True:
            for opcode, start, stop in records:
                content = data[start:stop]
                try:
                    self._take(opcode, content)
                except ValueError as error:
                    self._damaged.append(
                        f"a record of {stop - start} bytes at byte {start - HEAD.size} is damaged ({error})"
                    )
                else:
                    if opcode == Opcode.DATA_END:
                        return len(data)
                end = stop
            again = next_chunk(data, end)
            if again is None:
                break
            self._damaged.append(f"{again - end} bytes at byte {end} belong to no whole record")
            records, end = whole_records(data, again), again
        if end + HEAD.size <= len(data) and data[end] == Opcode.CHUNK:
            salvaged = self._take_messages(partial_chunk_data(data[end + HEAD.size :]))
            end = len(data) if salvaged else end
        return end

    def _take(self, opcode: int, content: Data) -> None:
        match opcode:
            case Opcode.SCHEMA:
                self._take_schema(parse(Schema, content))
            case Opcode.CHANNEL:
                self._take_channel(parse(Channel, content))
            case Opcode.ATTACHMENT:
                self.file.add_attachment(parse(Attachment, content))
            case Opcode.METADATA:
                metadata = parse(Metadata, content)
                self.file.add_metadata(metadata.name, metadata.metadata)
            case Opcode.CHUNK:
                self._take_chunk(content)
            case Opcode.MESSAGE:
                self._take_messages(HEAD.pack(opcode, len(content)) + bytes(content))
            case Opcode.HEADER | Opcode.DATA_END | Opcode.MESSAGE_INDEX:
                # Made anew; read all the same, for a byte that has turned may have made it one of these.
                parse(_MADE_ANEW[opcode], content)
            case _:
                raise ValueError(f"records of kind {opcode:02X} do not stand here")

    def _take_schema(self, schema: Schema) -> None:
        if schema.id not in self._schemas:
            self._schemas.add(schema.id)
            self.file.add_schema(schema)

    def _take_channel(self, channel: Channel) -> None:
        if channel.schema_id and channel.schema_id not in self._schemas:
            raise ValueError(f"the channel {channel.topic} has a schema that is not there")
        if channel.id not in self._channels:
            self._channels.add(channel.id)
            self.file.add_channel(channel)

    def _take_definitions(self, data: bytes) -> None:
        """Schemas and channels that other writers keep inside chunks."""
        for opcode, start, end in whole_records(data):
            if opcode == Opcode.SCHEMA:
                self._take_schema(parse(Schema, data[start:end]))
            elif opcode == Opcode.CHANNEL:
                self._take_channel(parse(Channel, data[start:end]))

    def _take_chunk(self, content: Data) -> None:
        """Append a whole chunk as it is, its index made anew from its messages."""
        chunk = parse(Chunk, content)
        data = chunk_data(chunk)
        self._take_definitions(data)
        offsets = message_offsets(data)
        if not self._channels.issuperset(offsets):
            self._take_messages(data)
            return
        self.file.flush()
        self.file.append_chunk(
            chunk,
            HEAD.pack(Opcode.CHUNK, len(content)) + bytes(content),
            {channel_id: _index_record(channel_id, places, data) for channel_id, places in offsets.items()},
            {channel_id: len(places) for channel_id, places in offsets.items()},
        )

    def _take_messages(self, data: bytes) -> int:
        """Add the whole messages of a piece of a chunk; returns how many."""
        self._take_definitions(data)
        offsets = message_offsets(data)
        for channel_id in offsets.keys() - self._channels:
            self._orphans += len(offsets.pop(channel_id))
        places = sorted((at, channel_id) for channel_id, found in offsets.items() for at in found)
        for at, channel_id in places:
            end = at + HEAD.size + int.from_bytes(data[at + 1 : at + 9], "little")
            self.file.add_message(channel_id, _log_ns(data, at), data[at:end])
        return len(places)


def _log_ns(data: bytes, at: int) -> int:
    return int.from_bytes(data[at + 15 : at + 23], "little")


def _index_record(channel_id: int, places: list[int], data: bytes) -> bytes:
    entries = b"".join(data[at + 15 : at + 23] + at.to_bytes(8, "little") for at in places)
    return INDEX_HEAD.pack(Opcode.MESSAGE_INDEX, 6 + len(entries), channel_id, len(entries)) + entries
