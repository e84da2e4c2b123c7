"""The last CAN frames before a stop, kept until the next one, as lines for people."""

from __future__ import annotations

from collections import deque
from collections.abc import Sequence

from driver.bus.frames import FRAME, FRAME_BYTES
from driver.cyclic.slot import Batch

CYCLES = 8
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

    def freeze(self) -> None:
        """Keep what has passed until now: time in s, bus, direction, identifier and bytes, oldest first."""
        lines: list[str] = []
        for batch in (batch for cycle in self._cycles for batch in cycle):
            bus, way = self._bus_names[batch.bus], "sent" if batch.sent else "received"
            for at in range(0, len(batch.data), FRAME_BYTES):
                can_id, length, data = FRAME.unpack_from(batch.data, at)
                shown = data[: min(length, 8)].hex(" ")
                lines.append(f"{batch.time_ns / 1e9:.6f} {bus} {way} {can_id & 0x1FFFFFFF:03X} {shown}".rstrip())
        self.frozen = tuple(lines[-LINES:])
