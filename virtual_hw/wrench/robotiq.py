"""Robotiq FT 300 over serial: Modbus RTU slave 9, and a stream that it starts and fifty FF bytes stop.

Frame, 16 bytes: 20 4E | i16×3 force, 1/100 N | i16×3 torque, 1/1000 N·m | CRC-16/Modbus, little-endian.
"""

from __future__ import annotations

import struct

import numpy as np

from config.schema import WrenchSensor
from virtual_hw.hidden.wrench_sensor import WrenchErrors
from virtual_hw.wrench.crc import crc_modbus
from virtual_hw.wrench.line import PtyLine
from virtual_hw.wrench.sensor import Sensor
from virtual_hw.wrench.transducer import Transducer

FRAME = struct.Struct("<2s6h")
HEADER = b"\x20\x4e"
SLAVE = 9
READ_HOLDING, WRITE_ONE, WRITE_MANY = 3, 6, 16
REQUEST_BYTES = {READ_HOLDING: 8, WRITE_ONE: 8}
ILLEGAL_FUNCTION, ILLEGAL_ADDRESS, ILLEGAL_VALUE = 1, 2, 3
STREAM_REGISTER, STREAM_ON = 410, 0x0200
WRENCH_REGISTER, FIRMWARE_REGISTER, SERIAL_REGISTER = 180, 500, 510
FIRMWARE = b"FTS\x02\x00\x04"
SERIAL_NUMBER = b"FTS\x00\x00\x2a\x00\x00"
STOP_BYTES = 50
RATE_HZ = 100.0
COUNTS = np.array([100.0] * 3 + [1000.0] * 3)
"""Counts a N and a N·m."""


class RobotiqSensor(Sensor):
    """An FT 300. It is silent until it is told to stream, and then hears nothing but the stop."""

    def __init__(self, sensor: WrenchSensor, errors: WrenchErrors, transducer: Transducer, line: PtyLine) -> None:
        super().__init__(sensor, transducer, line)
        self._range = np.array([sensor.range_n] * 3 + [sensor.range_nm] * 3)
        self._request = bytearray()
        self._stops = 0
        transducer.start(RATE_HZ * (1.0 + errors.crystal_ppm * 1e-6), 0)

    def _counts(self, wrench: list[float]) -> list[int]:
        clipped = np.clip(wrench, -self._range, self._range) * COUNTS
        return [int(c) for c in np.clip(np.rint(clipped), -32768, 32767)]

    def _frame(self, wrench: list[float], instant_ns: int, skipped: bool) -> bytes:
        body = FRAME.pack(HEADER, *self._counts(wrench))
        return body + struct.pack("<H", crc_modbus(body))

    def _hear(self, received: bytes, now_ns: int) -> None:
        for byte in received:
            if self._streaming:
                self._stops = self._stops + 1 if byte == 0xFF else 0
                if self._stops >= STOP_BYTES:
                    self._streaming, self._stops = False, 0
                    self._request.clear()
            else:
                self._request.append(byte)
                self._serve(now_ns)

    def _serve(self, now_ns: int) -> None:
        """Answer the request at the head of what was heard, when it is complete; skip bytes that are none."""
        request = self._request
        while len(request) >= 2:
            size = self._size()
            if size is not None and len(request) < size:
                return
            if size is not None and crc_modbus(bytes(request[: size - 2])) == int.from_bytes(
                request[size - 2 : size], "little"
            ):
                body = bytes(request[1 : size - 2])
                request.clear()
                self._answer(body, now_ns)
                return
            del request[0]

    def _size(self) -> int | None:
        """Length of the request that begins here; None when none can."""
        request = self._request
        if request[0] != SLAVE:
            return None
        function = request[1]
        if function == WRITE_MANY:
            return 9 + request[6] if len(request) > 6 else 9
        # A function that the sensor lacks has a length it cannot know; most requests are 8 bytes long.
        return REQUEST_BYTES.get(function, 8) if 0 < function < 0x80 else None

    def _answer(self, body: bytes, now_ns: int) -> None:
        function = body[0]
        reply = self._reply(function, body[1:])
        starts = isinstance(reply, bytes) and function != READ_HOLDING
        payload = reply if isinstance(reply, bytes) else bytes([reply])
        head = bytes([SLAVE, function if isinstance(reply, bytes) else function | 0x80])
        message = head + payload
        self.line.answer(message + struct.pack("<H", crc_modbus(message)), now_ns)
        self._streaming = starts

    def _reply(self, function: int, data: bytes) -> bytes | int:
        """What follows the function code, or the exception code."""
        if function == READ_HOLDING:
            return self._read(*struct.unpack(">HH", data))
        if function == WRITE_ONE:
            address, value = struct.unpack(">HH", data)
        elif function == WRITE_MANY:
            address, count, size = struct.unpack(">HHB", data[:5])
            if count != 1 or size != 2:
                return ILLEGAL_VALUE
            value = int.from_bytes(data[5:7], "big")
        else:
            return ILLEGAL_FUNCTION
        if address != STREAM_REGISTER:
            return ILLEGAL_ADDRESS
        if value != STREAM_ON:
            return ILLEGAL_VALUE
        return data[:4]

    def _read(self, address: int, count: int) -> bytes | int:
        wrench = struct.pack(">6h", *self._counts(self.latest))
        for first, content in (
            (WRENCH_REGISTER, wrench),
            (FIRMWARE_REGISTER, FIRMWARE),
            (SERIAL_REGISTER, SERIAL_NUMBER),
        ):
            begin, end = 2 * (address - first), 2 * (address - first + count)
            if count and begin >= 0 and end <= len(content):
                return bytes([2 * count]) + content[begin:end]
        return ILLEGAL_ADDRESS
