"""The structure of an MCAP file, read as far as it is whole: records, and where the messages of a chunk are."""

from __future__ import annotations

import re
import struct
import zlib
from collections.abc import Iterator
from io import BytesIO
from typing import NamedTuple, TypeVar

import lz4.frame  # type: ignore[import-untyped]
import zstandard
from mcap.data_stream import ReadDataStream
from mcap.exceptions import McapError
from mcap.opcode import Opcode
from mcap.records import Chunk
from mcap.writer import MCAP0_MAGIC

from driver.recording.message_records import RECORD_HEAD_BYTES

HEAD = struct.Struct("<BQ")
_CHUNK_HEAD = re.compile(bytes((Opcode.CHUNK,)) + rb".{4}\0{4}", re.DOTALL)
LARGEST_CHUNK_BYTES = 1 << 30
"""Uncompressed; a chunk that claims more is looked for no further."""
CHANNEL_ID = struct.Struct("<H")
UNREADABLE = (McapError, struct.error, OSError, OverflowError, MemoryError, ValueError, EOFError, IndexError)
"""What a wrong offset or length makes the mcap library's readers raise."""
Offsets = dict[int, list[int]]
"""By channel: where its message records start in a chunk's data."""
T = TypeVar("T")


class RecordPlace(NamedTuple):
    """A whole record: its opcode, and where its content starts and ends. Its head are the 9 bytes before."""

    opcode: int
    start: int
    end: int


def whole_records(data: bytes | memoryview, at: int = 0) -> Iterator[RecordPlace]:
    """The records from ``at`` on, until one is cut off, or is no record of an MCAP file."""
    size = len(data)
    while at + HEAD.size <= size:
        opcode, length = HEAD.unpack_from(data, at)
        start = at + HEAD.size
        if opcode == 0 or start + length > size:
            return
        yield RecordPlace(opcode, start, start + length)
        at = start + length
        if opcode == Opcode.FOOTER:
            return


def next_chunk(data: bytes | memoryview, at: int) -> int | None:
    """Where the next chunk begins whose content fits its checksum, from ``at`` on: behind bytes that are no record, a
    reader finds its feet again there."""
    for found in _CHUNK_HEAD.finditer(data, at):
        _, length = HEAD.unpack_from(data, found.start())
        start = found.start() + HEAD.size
        if start + length > len(data):
            continue
        try:
            chunk = parse(Chunk, data[start : start + length])
            if chunk.uncompressed_crc and chunk.uncompressed_size <= LARGEST_CHUNK_BYTES:
                chunk_data(chunk)
                return found.start()
        except ValueError:
            continue
    return None


class _Content(BytesIO):
    """Of a record; a length in it that reaches beyond is an error. A reader that takes what there is instead would call
    a chunk whole whose length another reader allocates."""

    def read(self, size: int | None = -1, /) -> bytes:
        data = super().read(size)
        if size is not None and size > len(data):
            raise EOFError(f"{size} bytes are announced where {len(data)} are left")
        return data


def parse(kind: type[T], data: bytes | memoryview) -> T:
    """One record of the mcap library's class ``kind`` from its content.

    Raises ValueError when the content is not what such a record holds.
    """
    try:
        record: T = kind.read(ReadDataStream(_Content(data)))  # type: ignore[attr-defined]
    except UNREADABLE as error:
        raise ValueError(f"not a {kind.__name__} record: {error!r}") from None
    return record


def chunk_data(chunk: Chunk) -> bytes:
    """The chunk's records, decompressed and checked. Raises ValueError when they are damaged."""
    try:
        if chunk.compression == "zstd":
            data = zstandard.decompress(chunk.data, max_output_size=chunk.uncompressed_size)
        elif chunk.compression == "lz4":
            data = bytes(lz4.frame.decompress(chunk.data))
        elif chunk.compression == "":
            data = bytes(chunk.data)
        else:
            raise ValueError(f"unknown compression {chunk.compression!r}")
    except (zstandard.ZstdError, RuntimeError, MemoryError, OverflowError) as error:
        raise ValueError(str(error)) from None
    if len(data) != chunk.uncompressed_size or (chunk.uncompressed_crc and zlib.crc32(data) != chunk.uncompressed_crc):
        raise ValueError("its checksum is wrong")
    return data


def partial_chunk_data(content: bytes | memoryview) -> bytes:
    """What can be decompressed of a chunk record that was cut off; nothing when not even its head is there."""
    stream = ReadDataStream(BytesIO(content))
    try:
        stream.read(28)
        compression = stream.read_prefixed_string()
        stream.read8()
    except (McapError, struct.error, UnicodeDecodeError):
        return b""
    rest = bytes(content[stream.count :])
    if compression == "":
        return rest
    decompressor = (
        zstandard.ZstdDecompressor().decompressobj() if compression == "zstd" else lz4.frame.LZ4FrameDecompressor()
    )
    try:
        return bytes(decompressor.decompress(rest))
    except (zstandard.ZstdError, RuntimeError):
        return b""


def message_offsets(data: bytes | memoryview) -> Offsets:
    """Where the message records in a chunk's data start, by channel; one that is cut off does not count."""
    offsets: Offsets = {}
    for opcode, start, end in whole_records(data):
        if opcode == Opcode.MESSAGE and end - start >= RECORD_HEAD_BYTES - HEAD.size:
            offsets.setdefault(CHANNEL_ID.unpack_from(data, start)[0], []).append(start - HEAD.size)
    return offsets


def is_mcap(head: bytes) -> bool:
    """Does a file that begins with these bytes call itself MCAP?"""
    return head.startswith(MCAP0_MAGIC)


def is_complete(data: bytes | memoryview) -> bool:
    """Does the file end as a finished one does?"""
    return bytes(data[-len(MCAP0_MAGIC) :]) == MCAP0_MAGIC and len(data) > 2 * len(MCAP0_MAGIC)
