"""Faults of a wrench sensor: its electronics, its line, its plug."""

from __future__ import annotations

import math
import struct
from abc import abstractmethod
from typing import Literal

from pydantic import PrivateAttr

from config import InputError
from virtual_hw.faults.fault import SensorFault, Stage
from virtual_hw.wrench import Sensor
from virtual_hw.wrench.crc import crc_modbus, crc_x25

_BOTA_BODY = struct.Struct("<H6fIf")


class FrameTamper(SensorFault):
    """Changes each frame of the stream."""

    _bota: bool = PrivateAttr(default=True)

    def begin(self, stage: Stage) -> None:
        sensor = stage.sensor(self.sensor)
        self._bota = sensor.sensor.protocol == "bota"
        sensor.tamper = self._tamper

    def end(self, stage: Stage) -> None:
        stage.sensor(self.sensor).tamper = None

    @abstractmethod
    def _tamper(self, frame: bytes) -> bytes:
        """What goes to the line in its place."""

    def _sealed(self, frame: bytes) -> bytes:
        """The frame with the checksum of its present content."""
        body = frame[:-2]
        return body + struct.pack("<H", crc_x25(body[1:]) if self._bota else crc_modbus(body))


class WrongCrc(FrameTamper):
    kind: Literal["wrench_crc"]

    def _tamper(self, frame: bytes) -> bytes:
        return frame[:-1] + bytes((frame[-1] ^ 0x5A,))


class FalseHeader(FrameTamper):
    """Headers inside the payload, and every third frame loses its own first byte."""

    kind: Literal["wrench_false_header"]
    _number: int = PrivateAttr(default=0)

    def _tamper(self, frame: bytes) -> bytes:
        self._number += 1
        headers, at = (b"\xaa\xaa\xaa\x3c", 3) if self._bota else (b"\x20\x4e", 2)
        frame = self._sealed(frame[:at] + headers + frame[at + len(headers) :])
        return frame[1:] if self._number % 3 == 0 else frame


class BytesLost(FrameTamper):
    """Every ``every``-th frame misses a byte in its middle."""

    kind: Literal["wrench_bytes_lost"]
    every: int = 2
    _number: int = PrivateAttr(default=0)

    def _tamper(self, frame: bytes) -> bytes:
        self._number += 1
        return frame[:9] + frame[10:] if self._number % self.every == 0 else frame


class Stalled(FrameTamper):
    """The stream stops."""

    kind: Literal["wrench_stall"]

    def _tamper(self, frame: bytes) -> bytes:
        return b""


class Frozen(FrameTamper):
    """The same values over and over, with a clock that goes on."""

    kind: Literal["wrench_frozen"]
    _first: bytes = PrivateAttr(default=b"")

    def _tamper(self, frame: bytes) -> bytes:
        self._first = self._first or frame
        if self._bota:
            return self._sealed(frame[:3] + self._first[3:27] + frame[27:])
        return self._first


class StatusBits(FrameTamper):
    """Bits of the Bota status word."""

    kind: Literal["wrench_status"]
    bits: int

    def _tamper(self, frame: bytes) -> bytes:
        status, *rest = _BOTA_BODY.unpack(frame[1:-2])
        return self._sealed(b"\xaa" + _BOTA_BODY.pack(status | self.bits, *rest) + b"\0\0")


class Values(FrameTamper):
    """One channel says something else: not a number, infinite, or at the end of its range."""

    kind: Literal["wrench_value"]
    channel: int = 2
    value: Literal["nan", "inf", "saturated"]

    def _tamper(self, frame: bytes) -> bytes:
        if self._bota:
            status, *rest = _BOTA_BODY.unpack(frame[1:-2])
            rest[self.channel] = {"nan": math.nan, "inf": math.inf, "saturated": 1e5}[self.value]
            return self._sealed(b"\xaa" + _BOTA_BODY.pack(status, *rest) + b"\0\0")
        at = 2 + 2 * self.channel
        return self._sealed(frame[:at] + struct.pack("<h", 32767) + frame[at + 2 :])


class ClockJump(FrameTamper):
    """The sensor's clock jumps by ``by_us``; ``to_wrap`` sets it short of its wrap at 2³² µs, which is no fault."""

    kind: Literal["wrench_clock"]
    by_us: int = 0
    to_wrap: bool = False
    _offset: int = PrivateAttr(default=0)

    def _tamper(self, frame: bytes) -> bytes:
        values = list(_BOTA_BODY.unpack(frame[1:-2]))
        if self.to_wrap:
            if not self._offset:
                self._offset = (1 << 32) - 50_000 - values[7]
        else:
            self._offset = self.by_us
        values[7] = (values[7] + self._offset) & 0xFFFF_FFFF
        return self._sealed(b"\xaa" + _BOTA_BODY.pack(*values) + b"\0\0")


class WrongBaud(FrameTamper):
    """The line runs at another baud rate: what arrives is noise with framing of its own (seeded)."""

    kind: Literal["wrench_baud"]
    _state: int = PrivateAttr(default=0x2545F491)

    def _tamper(self, frame: bytes) -> bytes:
        noise = bytearray()
        for _ in range(len(frame)):
            self._state = (self._state * 1664525 + 1013904223) & 0xFFFF_FFFF
            noise.append(self._state >> 24)
        return bytes(noise)


class Bursts(SensorFault):
    """A USB bridge with its default latency timer: bytes come in bursts of ``ms``."""

    kind: Literal["wrench_bursts"]
    ms: float = 16.0
    _before: int = PrivateAttr(default=0)

    def begin(self, stage: Stage) -> None:
        line = stage.sensor(self.sensor).line
        self._before, line.latency_ns = line.latency_ns, round(self.ms * 1e6)

    def end(self, stage: Stage) -> None:
        stage.sensor(self.sensor).line.latency_ns = self._before


class SensorGone(SensorFault):
    """Unplugged: its device disappears. It comes back under the same link when the fault ends, silent until asked."""

    kind: Literal["wrench_gone"]

    def begin(self, stage: Stage) -> None:
        stage.sensor(self.sensor).line.unplug()

    def end(self, stage: Stage) -> None:
        stage.sensor(self.sensor).line.plug_in()


def require_bota(fault: SensorFault, sensor: Sensor) -> None:
    """Raises InputError where a fault lives in fields that only Bota's frames have."""
    if isinstance(fault, StatusBits | ClockJump) and sensor.sensor.protocol != "bota":
        raise InputError("faults", f"{fault.sensor} has neither status word nor clock", "choose a Bota sensor")
