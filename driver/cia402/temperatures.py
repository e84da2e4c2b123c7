"""How warm the motors are: from the TPDOs in which their drives tell it, °C."""

from __future__ import annotations

import struct
from typing import NamedTuple

from config.schema import Installation
from driver.bus.frames import FRAME
from driver.cia402.mapping import temperature_map
from driver.cia402.pdo_input import pdo_struct

_HEAD_BYTES = 5
"""Identifier and length of a can_frame."""
_DATA = 8
"""Where the data of a can_frame starts."""


class Warmth(NamedTuple):
    """Joint number, and °C of its motor."""

    joint: int
    celsius: float


class TemperatureInput:
    """Decoder of all such TPDOs of an installation. It remembers nothing."""

    def __init__(self, installation: Installation) -> None:
        buses = [bus.name for bus in installation.bus]
        self._table: dict[tuple[int, bytes], tuple[int, struct.Struct, float]] = {}
        for number, joint in enumerate(installation.joint):
            drive = installation.drive_of(joint)
            pdo = temperature_map(joint, drive)
            if pdo is not None and drive.temperature is not None:
                head = FRAME.pack(pdo.cob_id, pdo.length, b"")[:_HEAD_BYTES]
                layout = pdo_struct(pdo, drive)
                self._table[buses.index(joint.bus), head] = number, layout, drive.temperature.celsius_per_count

    @property
    def joints(self) -> tuple[int, ...]:
        """Numbers of the joints whose drives tell it."""
        return tuple(sorted(number for number, _, _ in self._table.values()))

    def read(self, bus: int, frame: bytes) -> Warmth | None:
        """What the 16 bytes of a received can_frame tell; None where it is another one."""
        entry = self._table.get((bus, frame[:_HEAD_BYTES]))
        if entry is None:
            return None
        number, layout, celsius_per_count = entry
        return Warmth(number, layout.unpack_from(frame, _DATA)[0] * celsius_per_count)
