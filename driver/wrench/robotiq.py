"""Robotiq FT 300 over serial: its stream, and the Modbus RTU requests that start it.

Frame, 16 bytes: 20 4E | i16×3 force in 1/100 N | i16×3 torque in 1/1000 N·m | CRC-16/Modbus, all little-endian.
"""

from __future__ import annotations

import struct
from typing import ClassVar

from config.schema import WrenchSensor
from driver.cyclic.cycle import WrenchSample
from driver.wrench.crc import crc16_modbus
from driver.wrench.parser import WrenchParser

FRAME = struct.Struct("<2s6hH")
SLAVE = 9
READ, WRITE = 3, 16
FIRMWARE, SERIAL_NUMBER, SELECT_OUTPUT = 500, 510, 410
STREAM = 0x0200
STOP_STREAM = b"\xff" * 50
"""While it streams, the sensor listens for nothing but this."""


class RobotiqParser(WrenchParser):
    """Frames of an FT 300. They carry no time: those that arrive together are dated back by the sensor's period."""

    header: ClassVar[bytes] = b"\x20\x4e"
    frame_bytes: ClassVar[int] = FRAME.size

    def __init__(self, sensor: WrenchSensor) -> None:
        super().__init__(sensor)
        self._period_ns = round(1e9 / sensor.rate_hz)
        self._stamp_ns = 0

    def intact(self, frame: bytes) -> bool:
        return crc16_modbus(frame[:-2]) == frame[-2] | frame[-1] << 8

    def _samples(self, frames: list[bytes], now_ns: int) -> list[WrenchSample]:
        samples = []
        for behind, frame in zip(range(len(frames) - 1, -1, -1), frames, strict=True):
            _, fx, fy, fz, tx, ty, tz, _ = FRAME.unpack(frame)
            wrench = (fx / 100, fy / 100, fz / 100, tx / 1000, ty / 1000, tz / 1000)
            self._stamp_ns = max(self._stamp_ns + 1, now_ns - behind * self._period_ns - self._line_ns)
            samples.append(self._judged(wrench, 0, self._stamp_ns, now_ns))
        return samples


def _with_crc(body: bytes) -> bytes:
    return body + struct.pack("<H", crc16_modbus(body))


def read_request(register: int, count: int) -> bytes:
    """Modbus function 3: read ``count`` holding registers."""
    return _with_crc(struct.pack(">BBHH", SLAVE, READ, register, count))


def write_request(register: int, value: int) -> bytes:
    """Modbus function 16: write one register."""
    return _with_crc(struct.pack(">BBHHBH", SLAVE, WRITE, register, 1, 2, value))


def read_answer(received: bytes, count: int) -> bytes | None:
    """The 2·count bytes of the registers, out of whatever else came; None when no intact answer is there."""
    return _find(received, bytes([SLAVE, READ, 2 * count]), 5 + 2 * count, 3)


def write_answered(received: bytes, register: int) -> bool:
    """Did the sensor confirm the write?"""
    return _find(received, struct.pack(">BBHH", SLAVE, WRITE, register, 1), 8, 0) is not None


def _find(received: bytes, head: bytes, size: int, skip: int) -> bytes | None:
    at = received.find(head)
    while at >= 0:
        answer = received[at : at + size]
        if len(answer) == size and _with_crc(answer[:-2]) == answer:
            return answer[skip:-2]
        at = received.find(head, at + 1)
    return None


def identity(firmware: bytes, serial_number: bytes) -> str:
    """ "firmware FTS-1.2.3, serial number FTS-0012" from registers 500–502 and 510–513."""
    kind = firmware[:3].decode("ascii", "replace")
    version = ".".join(str(byte) for byte in firmware[3:6])
    number = int.from_bytes(serial_number[6:8] + serial_number[4:6], "big")
    return f"firmware {kind}-{version}, serial number {serial_number[:3].decode('ascii', 'replace')}-{number:04d}"
