"""An MCAP file that grows by whole chunks, and stays recoverable at every moment.

The layout of the records is the mcap library's; what it cannot do is take messages that are already encoded, and
go on from the intact part of a broken file.
"""

from __future__ import annotations

import os
import struct
import zlib
from collections.abc import Mapping
from importlib.metadata import version
from typing import BinaryIO

import zstandard
from mcap.data_stream import RecordBuilder
from mcap.opcode import Opcode
from mcap.records import (
    Attachment,
    AttachmentIndex,
    Channel,
    Chunk,
    ChunkIndex,
    DataEnd,
    Footer,
    Header,
    McapRecord,
    Metadata,
    MetadataIndex,
    Schema,
    Statistics,
    SummaryOffset,
)
from mcap.writer import LIBRARY_IDENTIFIER, MCAP0_MAGIC

LIBRARY = f"etude {LIBRARY_IDENTIFIER} zstandard/{version('zstandard')}"
CHUNK_BYTES = 512 * 1024
"""A chunk ends at this size even when nobody asks for a flush."""
ZSTD_LEVEL = 1
INDEX_HEAD = struct.Struct("<BQHI")


def encoded(*records: McapRecord) -> bytes:
    """The records as bytes, one behind the other."""
    builder = RecordBuilder()
    for record in records:
        record.write(builder)
    data: bytes = builder.end()  # type: ignore[no-untyped-call]
    return data


class ChunkedFile:
    """Writer of one MCAP file. Every method leaves the file ending with a whole record.

    Raises OSError when the disk refuses; the file is then cut back to its last whole record.
    """

    def __init__(self, stream: BinaryIO, profile: str = "ros2", library: str = LIBRARY) -> None:
        self._stream = stream
        self._size = 0
        self._schemas: dict[int, Schema] = {}
        self._channels: dict[int, Channel] = {}
        self._attachment_indexes: list[AttachmentIndex] = []
        self._metadata_indexes: list[MetadataIndex] = []
        self._chunk_indexes = bytearray()
        self._chunks = 0
        self._counts: dict[int, int] = {}
        self._first_ns: int | None = None
        self._last_ns = 0
        self._chunk = bytearray()
        self._index: dict[int, list[int]] = {}
        self._compressor = zstandard.ZstdCompressor(level=ZSTD_LEVEL)
        self._append(MCAP0_MAGIC + encoded(Header(profile, library)))

    @property
    def size(self) -> int:
        """Bytes on disk."""
        return self._size

    @property
    def messages(self) -> int:
        """Messages in whole chunks on disk."""
        return sum(self._counts.values())

    @property
    def seconds(self) -> float:
        """From the first to the last of those messages."""
        return 0.0 if self._first_ns is None else (self._last_ns - self._first_ns) / 1e9

    def add_schema(self, schema: Schema) -> None:
        self._schemas[schema.id] = schema
        self._append(encoded(schema))

    def add_channel(self, channel: Channel) -> None:
        self._channels[channel.id] = channel
        self._append(encoded(channel))

    def register_schema(self, name: str, definition: str) -> int:
        """Add a schema in ``ros2msg``; returns its number."""
        number = len(self._schemas) + 1
        self.add_schema(Schema(id=number, data=definition.encode(), encoding="ros2msg", name=name))
        return number

    def register_channel(self, topic: str, schema_id: int, metadata: Mapping[str, str]) -> int:
        """Add a channel of CDR messages; returns its number."""
        number = len(self._channels) + 1
        self.add_channel(
            Channel(id=number, topic=topic, message_encoding="cdr", metadata=dict(metadata), schema_id=schema_id)
        )
        return number

    def add_attachment(self, attachment: Attachment) -> None:
        self.flush()
        data = encoded(attachment)
        index = AttachmentIndex(
            offset=self._size,
            length=len(data),
            log_time=attachment.log_time,
            create_time=attachment.create_time,
            data_size=len(attachment.data),
            name=attachment.name,
            media_type=attachment.media_type,
        )
        self._append(data)
        self._attachment_indexes.append(index)

    def add_metadata(self, name: str, metadata: Mapping[str, str]) -> None:
        self.flush()
        data = encoded(Metadata(name=name, metadata=dict(metadata)))
        index = MetadataIndex(offset=self._size, length=len(data), name=name)
        self._append(data)
        self._metadata_indexes.append(index)

    def add_message(self, channel_id: int, log_ns: int, record: bytes) -> None:
        """Add a whole message record (see `message_records`) to the chunk in progress."""
        entries, chunk = self._index.get(channel_id), self._chunk
        if entries is None:
            entries = self._index[channel_id] = []
        entries += (log_ns, len(chunk))
        chunk += record
        if len(chunk) >= CHUNK_BYTES:
            self.flush()

    def flush(self) -> None:
        """End the chunk in progress and hand it to the operating system; nothing is written when it is empty."""
        if not self._index:
            return
        data, index = bytes(self._chunk), self._index
        self._chunk, self._index = bytearray(), {}
        times = [ns for entries in index.values() for ns in entries[::2]]
        chunk = Chunk(
            compression="zstd",
            data=self._compressor.compress(data),
            message_start_time=min(times),
            message_end_time=max(times),
            uncompressed_crc=zlib.crc32(data),
            uncompressed_size=len(data),
        )
        records = {
            channel_id: INDEX_HEAD.pack(
                Opcode.MESSAGE_INDEX, 6 + 8 * len(entries), channel_id, 8 * len(entries)
            ) + struct.pack(f"<{len(entries)}Q", *entries)
            for channel_id, entries in index.items()
        }  # fmt: skip
        self.append_chunk(chunk, encoded(chunk), records, {k: len(entries) // 2 for k, entries in index.items()})

    def append_chunk(
        self, chunk: Chunk, chunk_record: bytes, index_records: Mapping[int, bytes], counts: Mapping[int, int]
    ) -> None:
        """Append a chunk that is ready, as ``chunk_record``, with the message index record and the number of
        messages of each of its channels."""
        at = self._size + len(chunk_record)
        offsets = {}
        for channel_id, record in index_records.items():
            offsets[channel_id] = at
            at += len(record)
        index = ChunkIndex(
            message_start_time=chunk.message_start_time,
            message_end_time=chunk.message_end_time,
            chunk_start_offset=self._size,
            chunk_length=len(chunk_record),
            message_index_offsets=offsets,
            message_index_length=at - self._size - len(chunk_record),
            compression=chunk.compression,
            compressed_size=len(chunk.data),
            uncompressed_size=chunk.uncompressed_size,
        )
        self._append(b"".join((chunk_record, *index_records.values())))
        self._chunk_indexes += encoded(index)
        self._chunks += 1
        for channel_id, count in counts.items():
            self._counts[channel_id] = self._counts.get(channel_id, 0) + count
        if any(counts.values()):
            start = chunk.message_start_time
            self._first_ns = start if self._first_ns is None else min(self._first_ns, start)
            self._last_ns = max(self._last_ns, chunk.message_end_time)

    def finish(self) -> None:
        """End the last chunk and write the summary: the file is complete. The stream stays open."""
        self.flush()
        data_end = encoded(DataEnd(0))
        start = self._size + len(data_end)
        statistics = Statistics(
            attachment_count=len(self._attachment_indexes),
            channel_count=len(self._channels),
            channel_message_counts=self._counts,
            chunk_count=self._chunks,
            message_count=self.messages,
            message_end_time=self._last_ns,
            message_start_time=self._first_ns or 0,
            metadata_count=len(self._metadata_indexes),
            schema_count=len(self._schemas),
        )
        summary, offsets = b"", list[SummaryOffset]()
        for opcode, group in (
            (Opcode.SCHEMA, encoded(*self._schemas.values())),
            (Opcode.CHANNEL, encoded(*self._channels.values())),
            (Opcode.STATISTICS, encoded(statistics)),
            (Opcode.CHUNK_INDEX, bytes(self._chunk_indexes)),
            (Opcode.ATTACHMENT_INDEX, encoded(*self._attachment_indexes)),
            (Opcode.METADATA_INDEX, encoded(*self._metadata_indexes)),
        ):
            if group:
                offsets.append(SummaryOffset(opcode, start + len(summary), len(group)))
                summary += group
        offset_start = start + len(summary)
        summary += encoded(*offsets)
        checked = summary + struct.pack("<BQQQ", Opcode.FOOTER, 20, start, offset_start)
        footer = Footer(summary_start=start, summary_offset_start=offset_start, summary_crc=zlib.crc32(checked))
        self._append(data_end + summary + encoded(footer) + MCAP0_MAGIC)

    def _append(self, data: bytes) -> None:
        """Write all of it or nothing of it."""
        view, written = memoryview(data), 0
        try:
            while written < len(view):
                written += self._stream.write(view[written:]) or 0
        except OSError:
            os.ftruncate(self._stream.fileno(), self._size)
            self._stream.seek(self._size)
            raise
        self._size += written
