"""Bota Systems SensONE over serial: frames and configuration as its firmware has them.

Frame, 37 bytes little-endian: AA | u16 status | f32×6 | u32 timestamp µs | f32 °C | CRC-16/X-25 of bytes 1 to 34.
Commands are ASCII lines, acknowledged ``r,0,<command>,<0 = ok>``; in run mode only ``C`` is heard.
"""

from __future__ import annotations

import struct
from enum import IntFlag

import numpy as np

from config.schema import WrenchSensor
from virtual_hw.hidden.wrench_sensor import WrenchErrors
from virtual_hw.wrench.crc import crc_x25
from virtual_hw.wrench.line import BITS_A_BYTE, PtyLine
from virtual_hw.wrench.sensor import Sensor
from virtual_hw.wrench.transducer import Transducer

BODY = struct.Struct("<H6fIf")
FRAME_BYTES = 37
MODULATOR_HZ = 51_200
SINC_LENGTHS = range(51, 513)
BAUD_RATES = (9600, 57_600, 115_200, 230_400, 460_800)
LONGEST_COMMAND = 200
LARGEST_SETTING = 1e6
"""Beyond it, frames of 32-bit floats could overflow."""
DONE, REFUSED = 0, 1


class Status(IntFlag):
    SKIPPED_SAMPLES = 1
    OVER_RANGE = 2
    INVALID = 4
    RAW_GAUGES = 8


class BotaSensor(Sensor):
    """A SensONE. It streams from power-on, at the rate that the sinc filter's length sets."""

    def __init__(self, sensor: WrenchSensor, errors: WrenchErrors, transducer: Transducer, line: PtyLine) -> None:
        super().__init__(sensor, transducer, line)
        self._range = [sensor.range_n] * 3 + [sensor.range_nm] * 3
        self._offsets, self._calibration = np.zeros(6), np.eye(6)
        self._calibrated = True
        self._temperature = errors.temperature_c
        self._first_us, self._clock_rate = errors.first_timestamp_us, 1.0 + errors.crystal_ppm * 1e-6
        self._commands = bytearray()
        self._sinc = min(max(round(MODULATOR_HZ / sensor.rate_hz), SINC_LENGTHS[0]), SINC_LENGTHS[-1])
        self._run(0)

    @property
    def rate_hz(self) -> float:
        return MODULATOR_HZ / self._sinc

    def _run(self, now_ns: int) -> None:
        self._transducer.start(self.rate_hz, now_ns)
        self._streaming, self._skipped = True, False

    def _frame(self, wrench: list[float], instant_ns: int, skipped: bool) -> bytes:
        status = int(Status.SKIPPED_SAMPLES) if skipped else 0
        values: list[float] = (self._calibration.dot(wrench) + self._offsets).tolist()
        if any(abs(x) > most for x, most in zip(wrench, self._range, strict=True)):
            status |= Status.OVER_RANGE
            values = [min(max(x, -most), most) for x, most in zip(values, self._range, strict=True)]
        if not self._calibrated:
            status |= Status.RAW_GAUGES
            values = [x / most for x, most in zip(wrench, self._range, strict=True)]
        clock_us = self._first_us + int(instant_ns * self._clock_rate) // 1000
        body = BODY.pack(status, *values, clock_us & 0xFFFF_FFFF, self._temperature)
        return b"\xaa" + body + struct.pack("<H", crc_x25(body))

    def _hear(self, received: bytes, now_ns: int) -> None:
        self._commands += received
        while (end := self._commands.find(b"\n")) >= 0:
            line = bytes(self._commands[:end]).strip().decode("ascii", "replace")
            del self._commands[: end + 1]
            if line:
                self._obey(line, now_ns)
        if len(self._commands) > LONGEST_COMMAND:
            self._commands.clear()

    def _obey(self, line: str, now_ns: int) -> None:
        name, _, rest = line.partition(",")
        if self._streaming and name != "C":
            return
        if name == "C":
            self._streaming = False
            self._answer(name, DONE, now_ns)
        elif name == "R":
            self._answer(name, DONE, now_ns)
            self._run(now_ns)
        elif name == "w":
            settings = f"c,1,{int(self._calibrated)},0,{BAUD_RATES.index(self.line.baud)}\r\nf,{self._sinc},0,0,1\r\n"
            self.line.answer(settings.encode(), now_ns)
            self._answer(name, DONE, now_ns)
        else:
            self._answer(name, self._set(name, rest), now_ns)

    def _answer(self, name: str, code: int, now_ns: int) -> None:
        self.line.answer(f"r,0,{name},{code}\r\n".encode(), now_ns)

    def _set(self, name: str, rest: str) -> int:
        if name == "s":
            return DONE if not rest else REFUSED
        try:
            numbers = [float(word) for word in rest.split(",")]
        except ValueError:
            return REFUSED
        if not all(-LARGEST_SETTING <= number <= LARGEST_SETTING for number in numbers):
            return REFUSED
        if name == "c" and len(numbers) == 4:
            return self._set_communication(*numbers)
        if name == "f" and len(numbers) == 4:
            return self._set_filter(*numbers)
        if name == "b" and len(numbers) == 6:
            self._offsets = np.array(numbers)
            return DONE
        if name in ("m0", "m1", "m2", "m3", "m4", "m5") and len(numbers) == 6:
            self._calibration[int(name[1])] = numbers
            return DONE
        return REFUSED

    def _set_communication(self, compensate: float, calibrate: float, text: float, baud: float) -> int:
        """Temperature compensation, calibration, format, baud code. The stand-in sends binary frames alone."""
        if compensate not in (0, 1) or calibrate not in (0, 1) or text != 0 or baud not in range(len(BAUD_RATES)):
            return REFUSED
        rate = BAUD_RATES[int(baud)]
        if not _fits(rate, self._sinc):
            return REFUSED
        self._calibrated = calibrate == 1
        self.line.baud = rate
        return DONE

    def _set_filter(self, sinc: float, chop: float, fast: float, fir_disable: float) -> int:
        """The stand-in has the sinc filter alone: no chopping, no fast settling, no FIR."""
        if sinc not in SINC_LENGTHS or (chop, fast, fir_disable) != (0, 0, 1) or not _fits(self.line.baud, int(sinc)):
            return REFUSED
        self._sinc = int(sinc)
        return DONE


def _fits(baud: int, sinc: int) -> bool:
    return baud * sinc >= FRAME_BYTES * BITS_A_BYTE * MODULATOR_HZ
