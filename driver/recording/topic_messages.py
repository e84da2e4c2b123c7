"""Messages of chosen topics of an MCAP file, by the million: located by the file's own index, gathered with numpy."""

from __future__ import annotations

import mmap
from collections.abc import Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import TypeVar

import numpy as np
from mcap.opcode import Opcode
from mcap.reader import SeekingReader
from mcap.records import Attachment, Channel, Chunk, ChunkIndex, Metadata, Schema
from mcap.summary import Summary
from numpy.typing import NDArray

from config import InputError
from driver.recording.chunked_file import INDEX_HEAD
from driver.recording.mcap_records import (
    HEAD,
    UNREADABLE,
    chunk_data,
    is_complete,
    is_mcap,
    message_offsets,
    parse,
    whole_records,
)

BATCH_BYTES = 8 << 20
Indices = NDArray[np.int64]
Bytes = NDArray[np.uint8]
T = TypeVar("T")


@dataclass(frozen=True)
class Batch:
    """Some chunks' data behind one another, and where the message records of each wanted channel start in it."""

    data: Bytes
    offsets: Mapping[int, Indices]


class McapFile:
    """A complete MCAP file, open for reading. InputError when it is none, is cut off or damaged."""

    def __init__(self, path: Path) -> None:
        self.path = path
        try:
            self._stream = path.open("rb")
        except OSError as error:
            raise InputError(str(path), f"cannot be read ({error.strerror})", "check the path") from None
        head = self._stream.read(8)
        if not is_mcap(head):
            self._stream.close()
            raise self._not_mcap(head)
        self._data = mmap.mmap(self._stream.fileno(), 0, prot=mmap.PROT_READ)
        if not is_complete(memoryview(self._data)):
            self.close()
            raise InputError(str(path), "is cut off: it has no end", f"run: etude recover {path}")
        self.channels: dict[int, Channel] = {}
        self.schemas: dict[int, Schema] = {}
        self._stream.seek(0)
        self._reader = SeekingReader(self._stream)
        self._chunks = self._read_structure()

    def _not_mcap(self, head: bytes) -> InputError:
        if not head:
            return InputError(str(self.path), "is empty", "name another recording")
        if head.startswith(b"\x28\xb5\x2f\xfd"):
            return InputError(str(self.path), "is compressed as a whole", "unpack it first, with zstd -d")
        if head.startswith(b"SQLite"):
            return InputError(
                str(self.path), "is a rosbag2 database, not MCAP", "convert it first, with ros2 bag convert"
            )
        return InputError(str(self.path), "is not an MCAP file", "name an .mcap or .csv recording")

    def _read_structure(self) -> list[ChunkIndex]:
        """Channels and schemas from the summary; without one, from the data itself."""
        try:
            summary: Summary | None = self._reader.get_summary()
        except UNREADABLE as error:
            self.close()
            raise self.damaged(f"its summary cannot be read: {error!r}") from None
        if summary is not None and summary.channels:
            self.channels, self.schemas = dict(summary.channels), dict(summary.schemas)
            return sorted(summary.chunk_indexes, key=lambda c: (c.message_start_time, c.chunk_start_offset))
        for _ in self._scan():
            pass
        return []

    def damaged(self, what: str) -> InputError:
        return InputError(str(self.path), f"is damaged: {what}", f"run: etude recover {self.path}")

    def topics(self) -> dict[str, str]:
        """Message type by topic."""
        return {c.topic: s.name if (s := self.schemas.get(c.schema_id)) else "" for c in self.channels.values()}

    def channels_of(self, topic: str) -> list[Channel]:
        return [channel for channel in self.channels.values() if channel.topic == topic]

    def attachments(self) -> list[Attachment]:
        return self._listed("attachments", self._reader.iter_attachments())

    def metadata(self) -> list[Metadata]:
        return self._listed("metadata", self._reader.iter_metadata())

    def _listed(self, what: str, records: Iterator[T]) -> list[T]:
        try:
            return list(records)
        except UNREADABLE as error:
            raise self.damaged(f"its {what} cannot be read: {error!r}") from None

    def batches(self, wanted: frozenset[int]) -> Iterator[Batch]:
        """Messages of the ``wanted`` channels, in the order of their chunks."""
        parts, offsets, size = list[bytes](), dict[int, list[Indices]](), 0
        for data, found in self._indexed(wanted) if self._chunks else self._scan():
            for channel_id, places in found.items():
                if channel_id in wanted:
                    offsets.setdefault(channel_id, []).append(places + size)
            parts.append(data)
            size += len(data)
            if size >= BATCH_BYTES:
                yield _batch(parts, offsets)
                parts, offsets, size = [], {}, 0
        if parts:
            yield _batch(parts, offsets)

    def _indexed(self, wanted: frozenset[int]) -> Iterator[tuple[bytes, dict[int, Indices]]]:
        for index in self._chunks:
            if index.message_index_offsets and wanted.isdisjoint(index.message_index_offsets):
                continue
            start = index.chunk_start_offset
            data = self._chunk(start, start + index.chunk_length)
            if not index.message_index_offsets:
                yield data, _as_arrays(message_offsets(data))
                continue
            found = {}
            for channel_id in wanted.intersection(index.message_index_offsets):
                found[channel_id] = self._places(index.message_index_offsets[channel_id], channel_id, data)
            yield data, found

    def _places(self, at: int, channel_id: int, data: bytes) -> Indices:
        """Where a channel's message records start in a chunk's data, by the index record at byte ``at``."""
        try:
            opcode, length, channel, size = INDEX_HEAD.unpack_from(self._data, at)
            if (opcode, length, channel) != (Opcode.MESSAGE_INDEX, size + 6, channel_id):
                raise ValueError("no message index of its channel is there")
            entries = np.frombuffer(self._data, "<u8", 2 * (size // 16), at + INDEX_HEAD.size)
            places = entries[1::2].astype(np.int64)
            if np.any(places < 0) or np.any(np.frombuffer(data, np.uint8)[places] != Opcode.MESSAGE):
                raise ValueError("it names places where no message is")
        except UNREADABLE as error:
            raise self.damaged(f"the message index at byte {at}: {error}") from None
        return places

    def _chunk(self, start: int, end: int) -> bytes:
        try:
            opcode, length = HEAD.unpack_from(self._data, start)
            if opcode != Opcode.CHUNK or start + HEAD.size + length != end:
                raise ValueError("no chunk is where the index says")
            return chunk_data(parse(Chunk, self._data[start + HEAD.size : end]))
        except UNREADABLE as error:
            raise self.damaged(f"the chunk at byte {start}: {error}") from None

    def _scan(self) -> Iterator[tuple[bytes, dict[int, Indices]]]:
        """All messages of a file without index, and its channels and schemas as they come."""
        for opcode, start, end in whole_records(memoryview(self._data), 8):
            data = self._data[start - HEAD.size : end]
            if opcode == Opcode.CHUNK:
                data = self._chunk(start - HEAD.size, end)
            elif opcode not in (Opcode.SCHEMA, Opcode.CHANNEL, Opcode.MESSAGE):
                continue
            try:
                self._take_definitions(data)
            except ValueError as error:
                raise self.damaged(f"the record at byte {start - HEAD.size}: {error}") from None
            yield data, _as_arrays(message_offsets(data))

    def _take_definitions(self, data: bytes) -> None:
        for kind, first, last in whole_records(data):
            if kind == Opcode.SCHEMA:
                schema = parse(Schema, data[first:last])
                self.schemas[schema.id] = schema
            elif kind == Opcode.CHANNEL:
                channel = parse(Channel, data[first:last])
                self.channels[channel.id] = channel

    def close(self) -> None:
        self._stream.close()

    def __enter__(self) -> McapFile:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()


def _as_arrays(offsets: Mapping[int, list[int]]) -> dict[int, Indices]:
    return {channel_id: np.array(places, dtype=np.int64) for channel_id, places in offsets.items()}


def _batch(parts: list[bytes], offsets: Mapping[int, list[Indices]]) -> Batch:
    data = np.frombuffer(b"".join(parts), np.uint8)
    return Batch(data, {channel_id: np.concatenate(places) for channel_id, places in offsets.items()})


def records_by_length(batch: Batch, channel_id: int) -> Iterator[tuple[Indices, Bytes]]:
    """(positions among the channel's messages, whole message records as rows) for each length that occurs."""
    offsets = batch.offsets.get(channel_id)
    if offsets is None or not len(offsets):
        return
    heads = batch.data[offsets[:, None] + np.arange(1, 9)]
    lengths = np.ascontiguousarray(heads).view("<u8")[:, 0].astype(np.int64) + HEAD.size
    for length in np.unique(lengths):
        positions = np.flatnonzero(lengths == length)
        yield positions, batch.data[offsets[positions, None] + np.arange(length)]
