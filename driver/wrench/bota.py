"""Bota Systems SensONE over serial: its frames, and the lines that configure it.

Frame, 37 bytes little-endian: AA | u16 status | f32×6 Fx Fy Fz Tx Ty Tz | u32 time µs | f32 °C | u16 CRC-16/X-25.
"""

from __future__ import annotations

import re
import struct
from typing import ClassVar

from config import InputError
from config.schema import WrenchSensor
from driver.cyclic.cycle import WrenchSample
from driver.wrench.crc import crc16_x25
from driver.wrench.parser import SampleStatus, WrenchParser
from driver.wrench.sensor_clock import SensorClock

FRAME = struct.Struct("<BH6fIfH")
NAMED_STATUS = 0x000F
MODULATOR_HZ = 51_200
"""Output rate = 51 200 Hz / sinc length: 51 gives 1004 Hz, 512 gives 100 Hz."""
SINC = range(51, 513)
BAUD_CODE = {9600: 0, 57_600: 1, 115_200: 2, 230_400: 3, 460_800: 4}
BITS_A_FRAME = FRAME.size * 10


class BotaParser(WrenchParser):
    """Frames of a SensONE. Its clock must go on from frame to frame: the first frame of a stream only starts it."""

    header: ClassVar[bytes] = b"\xaa"
    frame_bytes: ClassVar[int] = FRAME.size

    def __init__(self, sensor: WrenchSensor) -> None:
        super().__init__(sensor)
        self._clock: SensorClock | None = None
        self._suspect: SensorClock | None = None

    def intact(self, frame: bytes) -> bool:
        return crc16_x25(frame[1:-2]) == frame[-2] | frame[-1] << 8

    def _samples(self, frames: list[bytes], now_ns: int) -> list[WrenchSample]:
        samples = []
        for number, frame in enumerate(frames, 1):
            _, status, fx, fy, fz, tx, ty, tz, reading_us, _, _ = FRAME.unpack(frame)
            if status & ~NAMED_STATUS:
                status |= SampleStatus.UNKNOWN_STATUS
            stamp_ns = self._host_time(reading_us, now_ns, newest=number == len(frames))
            if stamp_ns is None:
                status |= SampleStatus.TIME_JUMP
                stamp_ns = now_ns
            samples.append(self._judged((fx, fy, fz, tx, ty, tz), status, stamp_ns - self._line_ns, now_ns))
        return samples

    def _host_time(self, reading_us: int, now_ns: int, *, newest: bool) -> int | None:
        """Host time of a reading that goes on from an earlier one; else None, and the reading is remembered.

        A restarted sensor is believed at its second frame, a stray frame never.
        """
        if self._clock is None or not self._clock.continued_by(reading_us, now_ns):
            if self._suspect is None or not self._suspect.continued_by(reading_us, now_ns):
                self._suspect = SensorClock(reading_us, now_ns)
                return None
            self._clock = self._suspect
        self._suspect = None
        return self._clock.advance(reading_us, now_ns, newest=newest)


def sinc_length(sensor: WrenchSensor) -> int:
    """Length of the sinc filter that gives the configured rate within 1 %; InputError when none does,
    or when the line is too slow to carry it."""
    sinc = round(MODULATOR_HZ / sensor.rate_hz)
    if sinc not in SINC or abs(MODULATOR_HZ / sinc / sensor.rate_hz - 1) > 0.01:
        raise InputError(
            f"wrench sensor {sensor.name}",
            f"a SensONE cannot be set to {sensor.rate_hz:g} Hz",
            "set rate_hz between 100 and 1000",
        )
    if BITS_A_FRAME * sensor.rate_hz > sensor.baud:
        raise InputError(
            f"wrench sensor {sensor.name}",
            f"{sensor.rate_hz:g} frames of {BITS_A_FRAME} bits a second do not fit a line of {sensor.baud} baud",
            f"set rate_hz to at most {sensor.baud // BITS_A_FRAME}",
        )
    return sinc


def configuration(sensor: WrenchSensor) -> list[tuple[str, str]]:
    """(command, line) in order: configuration mode, format and filter, run. Each is acknowledged.

    Temperature compensation and calibration on, binary format; plain sinc filter without chopping or FIR,
    so that the delay is known: half the filter's length.
    """
    if sensor.baud not in BAUD_CODE:
        raise InputError(
            f"wrench sensor {sensor.name}",
            f"a SensONE does not speak at {sensor.baud} baud",
            f"set baud to one of {', '.join(map(str, BAUD_CODE))}",
        )
    return [
        ("C", "C"),
        ("c", f"c,1,1,0,{BAUD_CODE[sensor.baud]}"),
        ("f", f"f,{sinc_length(sensor)},0,0,1"),
        ("R", "R"),
    ]


def acknowledgement(command: str, received: bytes) -> int | None:
    """Return code in the acknowledgement ``r,0,<command>,<code>`` of a command, 0 for done; None when there is none.

    ``received`` may hold the rest of the measurement stream.
    """
    found = re.search(rb"r,\d+,%s,(-?\d+)[\r\n]" % command.encode(), received)
    return int(found[1]) if found else None
