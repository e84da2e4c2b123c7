"""Encoders of the messages of a recording: from numbers to a whole MCAP message record, in one ``struct`` packing.

The body is CDR, little-endian (OMG DDS-RTPS, XCDR1: every field aligned to its size, counted from behind the four
bytes of encapsulation). What never changes, names and lengths and padding, is prepared once.
"""

from __future__ import annotations

import math
import struct
from collections.abc import Sequence
from typing import ClassVar

ENCAPSULATION = b"\x00\x01\x00\x00"
"""CDR, little-endian."""
MESSAGE_OPCODE = 0x05
RECORD_HEAD = struct.Struct("<BQHIQQ")
"""MCAP message record: opcode, length, channel, sequence, log time, publish time."""
RECORD_HEAD_BYTES = RECORD_HEAD.size
LENGTH_BEHIND = RECORD_HEAD_BYTES - 9
SECOND = 1_000_000_000
U32 = struct.Struct("<I")


def cdr_string(text: str) -> bytes:
    """Length with the final NUL, text, NUL; not padded."""
    data = text.encode()
    return U32.pack(len(data) + 1) + data + b"\0"


def _aligned(body: bytes, size: int) -> bytes:
    return body + b"\0" * (-len(body) % size)


def _string_sequence(body: bytes, names: Sequence[str]) -> bytes:
    body = _aligned(body, 4) + U32.pack(len(names))
    for name in names:
        body = _aligned(body, 4) + cdr_string(name)
    return body


def _head(channel_id: int, body_bytes: int) -> bytes:
    """Opcode, length and channel of a record whose body (with encapsulation) is that long."""
    return struct.pack("<BQH", MESSAGE_OPCODE, LENGTH_BEHIND + body_bytes, channel_id)


class JointStateRecord:
    """sensor_msgs/msg/JointState of fixed joints; ``fields`` says which of position, velocity, effort are filled."""

    def __init__(self, channel_id: int, names: Sequence[str], fields: tuple[bool, bool, bool]) -> None:
        stamp = bytes(8)
        before = _string_sequence(stamp + cdr_string(""), names)
        at = len(before)
        layout, self._between = "", list[bytes]()
        constant = before[8:]
        for filled in fields:
            constant += b"\0" * (-at % 4) + U32.pack(len(names) if filled else 0)
            at = at + -at % 4 + 4
            if filled and names:
                constant += b"\0" * (-at % 8)
                at += -at % 8 + 8 * len(names)
                layout += f"{len(constant)}s{len(names)}d"
                self._between.append(constant)
                constant = b""
        if constant:
            layout += f"{len(constant)}s"
            self._between.append(constant)
        self._head = _head(channel_id, 4 + at)
        self._struct = struct.Struct("<11sIQQ4siI" + layout)
        self._filled = sum(fields)

    def pack(self, sequence: int, log_ns: int, stamp_ns: int, *columns: Sequence[float]) -> bytes:
        """One record. ``columns``: the filled fields in order, one number a joint."""
        seconds, nanoseconds = divmod(stamp_ns, SECOND)
        values: list[bytes | float] = []
        for constant, column in zip(self._between, columns, strict=False):
            values.append(constant)
            values += column
        if len(self._between) > self._filled:
            values.append(self._between[-1])
        return self._struct.pack(
            self._head, sequence, log_ns, stamp_ns, ENCAPSULATION, seconds, nanoseconds, *values
        )  # fmt: skip


class _StampedNumbers:
    """A header of one frame, and ``count`` numbers of float64."""

    count: ClassVar[int]

    def __init__(self, channel_id: int, frame: str) -> None:
        before = _aligned(bytes(8) + cdr_string(frame), 8)
        self._frame = before[8:]
        self._head = _head(channel_id, 4 + len(before) + 8 * self.count)
        self._struct = struct.Struct(f"<11sIQQ4siI{len(self._frame)}s{self.count}d")

    def _pack(self, sequence: int, log_ns: int, stamp_ns: int, numbers: Sequence[float]) -> bytes:
        return self._struct.pack(
            self._head, sequence, log_ns, stamp_ns, ENCAPSULATION, *divmod(stamp_ns, SECOND), self._frame, *numbers
        )


class WrenchRecord(_StampedNumbers):
    """geometry_msgs/msg/WrenchStamped in one frame."""

    count = 6

    def pack(self, sequence: int, log_ns: int, stamp_ns: int, wrench: Sequence[float]) -> bytes:
        """One record: Fx, Fy, Fz in N, Tx, Ty, Tz in N·m."""
        return self._pack(sequence, log_ns, stamp_ns, wrench)


class TemperatureRecord(_StampedNumbers):
    """sensor_msgs/msg/Temperature of one joint, whose name is the frame."""

    count = 2

    def pack(self, sequence: int, log_ns: int, stamp_ns: int, celsius: float) -> bytes:
        """One record: °C; the variance is zero, which means that it is not known."""
        return self._pack(sequence, log_ns, stamp_ns, (celsius, 0.0))


class CanFrameRecord:
    """can_msgs/msg/Frame; ``header.frame_id`` is the direction, ``tx`` sent by the host or ``rx`` received."""

    DIRECTION = (cdr_string("rx") + b"\0", cdr_string("tx") + b"\0")
    EXTENDED, REMOTE, ERROR = 0x8000_0000, 0x4000_0000, 0x2000_0000

    def __init__(self, channel_id: int) -> None:
        self._head = _head(channel_id, 4 + 32)
        self._struct = struct.Struct("<11sIQQ4siI8s")

    def head(self, sequence: int, log_ns: int, stamp_ns: int, sent: bool) -> bytes:
        """What the records of frames that passed together have in common; `pack` takes it."""
        seconds, nanoseconds = divmod(stamp_ns, SECOND)
        return self._struct.pack(
            self._head, sequence, log_ns, stamp_ns, ENCAPSULATION, seconds, nanoseconds, self.DIRECTION[sent]
        )

    @classmethod
    def pack(cls, head: bytes, frame: bytes) -> bytes:
        """One record of a 16-byte struct can_frame. Error frames keep their class bits as identifier."""
        if not frame[3] & 0xE0:
            return head + frame[:4] + b"\0\0\0" + frame[4:5] + frame[8:]
        word = U32.unpack_from(frame)[0]
        flags = bytes(bool(word & bit) for bit in (cls.REMOTE, cls.EXTENDED, cls.ERROR))
        return head + U32.pack(word & 0x1FFF_FFFF) + flags + frame[4:5] + frame[8:]

    @classmethod
    def unpack(cls, body: bytes) -> tuple[bool, int, bytes]:
        """(sent, stamp in ns, 16 bytes of struct can_frame) from a message's CDR: the inverse of `pack`."""
        seconds, nanoseconds, direction, word, remote, extended, error, length, data = struct.unpack_from(
            "<iI8sI???B8s", body, 4
        )
        word |= remote * cls.REMOTE | extended * cls.EXTENDED | error * cls.ERROR
        frame = struct.pack("<IB3x8s", word, length, data)
        return direction == cls.DIRECTION[True], seconds * SECOND + nanoseconds, frame


class BytesRecord:
    """std_msgs/msg/UInt8MultiArray without dimensions: bytes as they came off a serial line."""

    HEAD = struct.Struct("<4sIII")

    def __init__(self, channel_id: int) -> None:
        self.channel_id = channel_id

    def pack(self, sequence: int, log_ns: int, data: bytes) -> bytes:
        length = LENGTH_BEHIND + self.HEAD.size + len(data)
        return (
            RECORD_HEAD.pack(MESSAGE_OPCODE, length, self.channel_id, sequence, log_ns, log_ns)
            + self.HEAD.pack(ENCAPSULATION, 0, 0, len(data))
            + data
        )

    @classmethod
    def unpack(cls, body: bytes) -> bytes:
        """The bytes from a message's CDR: the inverse of `pack`."""
        return body[cls.HEAD.size : cls.HEAD.size + cls.HEAD.unpack_from(body)[3]]


class LogRecord:
    """rcl_interfaces/msg/Log: one sentence with a level."""

    INFO, WARN, ERROR = 20, 30, 40

    def __init__(self, channel_id: int, name: str) -> None:
        self.channel_id = channel_id
        self._name = name

    def pack(self, sequence: int, log_ns: int, level: int, text: str) -> bytes:
        body = struct.pack("<iIB", *divmod(log_ns, SECOND), level)
        for string in (self._name, text, "", ""):
            body = _aligned(body, 4) + cdr_string(string)
        body = _aligned(body, 4) + U32.pack(0)
        length = LENGTH_BEHIND + 4 + len(body)
        head = RECORD_HEAD.pack(MESSAGE_OPCODE, length, self.channel_id, sequence, log_ns, log_ns)
        return head + ENCAPSULATION + body

    @staticmethod
    def unpack(body: bytes) -> tuple[int, str]:
        """(level, text) from a message's CDR."""
        level, at, texts = body[12], 13, list[str]()
        for _ in range(2):
            at += -(at - 4) % 4
            (size,) = U32.unpack_from(body, at)
            texts.append(body[at + 4 : at + 4 + size - 1].decode(errors="replace"))
            at += 4 + size
        return level, texts[1]


NO_WRENCH = (math.nan,) * 6
"""What stands in /wrench for a sample that the sensor or the host found fault with."""
