"""The 16-byte Linux ``struct can_frame`` and the marks of the local bus: the one codec that every channel shares.

Layout (linux/can.h, little-endian hosts): u32 identifier with flags, u8 data length, 3 bytes of padding,
8 data bytes. A frame with the identifier 0xFFFFFFFF is a *mark* of the local bus, never a CAN frame
(docs/architecture.md, "The local bus").
"""

from __future__ import annotations

import struct
from collections.abc import Iterator
from enum import IntEnum
from typing import NamedTuple, TypeAlias

Buffer: TypeAlias = bytes | bytearray | memoryview

FRAME = struct.Struct("<IB3x8s")
FRAME_BYTES = FRAME.size
EXTENDED_FLAG = 0x8000_0000
REMOTE_FLAG = 0x4000_0000
ERROR_FLAG = 0x2000_0000
STANDARD_MASK = 0x7FF
EXTENDED_MASK = 0x1FFF_FFFF
MARK_ID = 0xFFFF_FFFF
MARK_ID_BYTES = b"\xff\xff\xff\xff"
_MARK = struct.Struct("<IB3xQ")


class MarkKind(IntEnum):
    """Kinds of marks; the kind stands in the length field."""

    TICK = 1
    MARK = 2
    SERIAL = 3
    HELLO = 4


class Frame(NamedTuple):
    """One CAN frame: identifier with the flags of linux/can.h, and 0 to 8 data bytes."""

    can_id: int
    data: bytes


class Mark(NamedTuple):
    """One mark: its kind and the little-endian u64 it carries."""

    kind: MarkKind
    value: int


def pack(can_id: int, data: bytes = b"") -> bytes:
    """The 16 bytes of one data frame.

    Raises ValueError for more than 8 data bytes or an identifier that no controller can send.
    """
    if len(data) > 8:
        raise ValueError(f"{len(data)} data bytes do not fit a CAN frame of 8")
    identifier = can_id & EXTENDED_MASK
    extended = bool(can_id & EXTENDED_FLAG)
    if can_id < 0 or can_id == MARK_ID or can_id > MARK_ID or (not extended and identifier > STANDARD_MASK):
        raise ValueError(f"0x{can_id:X} is no CAN identifier")
    return FRAME.pack(can_id, len(data), data)


def pack_mark(kind: MarkKind, value: int) -> bytes:
    """The 16 bytes of one mark; ``value`` is a u64 (nanoseconds for TICK, MARK and HELLO)."""
    return _MARK.pack(MARK_ID, kind, value)


def unpack(buffer: Buffer, offset: int = 0) -> Frame | Mark:
    """The frame or mark at ``offset``.

    Raises ValueError when fewer than 16 bytes are left, the length exceeds 8, or a mark is of no known kind:
    such bytes are no frame at all.
    """
    if len(buffer) - offset < FRAME_BYTES:
        raise ValueError(f"{len(buffer) - offset} bytes are not a frame of {FRAME_BYTES}")
    can_id, length, data = FRAME.unpack_from(buffer, offset)
    if can_id == MARK_ID:
        return Mark(MarkKind(length), int.from_bytes(data, "little"))
    if length > 8:
        raise ValueError(f"a CAN frame cannot carry {length} bytes")
    return Frame(can_id, data[:length])


def iter_frames(buffer: Buffer) -> Iterator[Frame | Mark]:
    """Every frame and mark of a packet, in order; raises ValueError like `unpack`."""
    if len(buffer) % FRAME_BYTES:
        raise ValueError(f"{len(buffer)} bytes are not whole frames of {FRAME_BYTES}")
    for offset in range(0, len(buffer), FRAME_BYTES):
        yield unpack(buffer, offset)
