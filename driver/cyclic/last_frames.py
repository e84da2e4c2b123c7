"""The last CAN frames before a stop, kept until the next one, as lines for people."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from driver.bus.frames import FRAME, FRAME_BYTES
from driver.cyclic.slot import Batch

CYCLES = 8
OVERHEAD_BITS = 47
"""Bits of a frame beside its data, without stuffing."""
LINES = 100


class LastFrames:
    """Batches of the last cycles; `freeze` turns them into lines."""

    def __init__(self, bus_names: Sequence[str]) -> None:
        self._bus_names = tuple(bus_names)
        self._cycles: deque[Sequence[Batch]] = deque(maxlen=CYCLES)
        self.frozen: tuple[str, ...] = ()

    def add(self, batches: Sequence[Batch]) -> None:
        """The batches of one more cycle."""
        self._cycles.append(batches)

    def bits_per_frame(self, bus: int) -> float:
        """Mean length of the frames on one bus in these cycles, bits without stuffing."""
        frames = [data for cycle in self._cycles for number, _, _, data in cycle if number == bus]
        count = sum(len(data) // FRAME_BYTES for data in frames)
        octets = sum(sum(data[4::FRAME_BYTES]) for data in frames)
        return OVERHEAD_BITS + 8 * octets / count if count else 0.0

    def freeze(self) -> None:
        """Keep what has passed until now: time in s, bus, direction, identifier and bytes, oldest first."""
        lines: list[str] = []
        for number, sent, time_ns, frames in (batch for cycle in self._cycles for batch in cycle):
            bus, way = self._bus_names[number], "sent" if sent else "received"
            for can_id, length, data in FRAME.iter_unpack(frames):
                shown = data[: min(length, 8)].hex(" ")
                lines.append(f"{time_ns / 1e9:.6f} {bus} {way} {can_id & 0x1FFFFFFF:03X} {shown}".rstrip())
        self.frozen = tuple(lines[-LINES:])
