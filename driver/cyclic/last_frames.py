"""What passed on every bus and serial line before a stop, kept until the next one, as lines for people."""

from __future__ import annotations

from collections import deque
from collections.abc import Iterator, Sequence

from driver.bus.frames import FRAME, FRAME_BYTES
from driver.cyclic.slot import Batch, Serial

CYCLES = 8
OVERHEAD_BITS = 47
"""Bits of a frame beside its data, without stuffing."""
LINES = 100
"""Of each bus, so that one that babbles leaves the others theirs."""
DELIVERIES = 16
"""Of each serial line; a slow sensor's frames are farther apart than the cycles that are kept."""
BYTES_A_LINE = 37
"""A frame of a SensONE."""
Line = tuple[int, str]
"""Time in ns, and the text."""


class LastFrames:
    """Batches of the last cycles and deliveries of the serial lines; `freeze` turns them into text."""

    def __init__(self, bus_names: Sequence[str], sensor_names: Sequence[str] = ()) -> None:
        self._bus_names, self._sensor_names = tuple(bus_names), tuple(sensor_names)
        self._cycles: deque[Sequence[Batch]] = deque(maxlen=CYCLES)
        self._serial: list[deque[tuple[int, bytes]]] = [deque(maxlen=DELIVERIES) for _ in sensor_names]
        self.frozen: tuple[str, ...] = ()

    def add(self, batches: Sequence[Batch], serial: Sequence[Serial] = (), now_ns: int = 0) -> None:
        """What one more cycle brought; ``now_ns``: when the serial lines were read."""
        self._cycles.append(batches)
        for sensor, data in serial:
            self._serial[sensor].append((now_ns, data))

    def bits_per_frame(self, bus: int) -> float:
        """Mean length of the frames on one bus in these cycles, bits without stuffing."""
        frames = [data for cycle in self._cycles for number, _, _, data in cycle if number == bus]
        count = sum(len(data) // FRAME_BYTES for data in frames)
        octets = sum(sum(data[4::FRAME_BYTES]) for data in frames)
        return OVERHEAD_BITS + 8 * octets / count if count else 0.0

    def freeze(self) -> None:
        """Keep what has passed until now, oldest first: time in s, bus, direction, identifier and bytes of each frame;
        time, sensor and bytes of what its line brought."""
        lines = list[Line]()
        for bus in range(len(self._bus_names)):
            lines += list(self._frames_of(bus))[-LINES:]
        for name, deliveries in zip(self._sensor_names, self._serial, strict=True):
            for time_ns, data in deliveries:
                lines += [
                    (time_ns, f"{time_ns / 1e9:.6f} {name} received {data[at : at + BYTES_A_LINE].hex(' ')}")
                    for at in range(0, len(data), BYTES_A_LINE)
                ]
        self.frozen = tuple(text for _, text in sorted(lines, key=lambda line: line[0]))

    def _frames_of(self, bus: int) -> Iterator[Line]:
        name = self._bus_names[bus]
        for number, sent, time_ns, frames in (batch for cycle in self._cycles for batch in cycle):
            if number == bus:
                way = "sent" if sent else "received"
                for can_id, length, data in FRAME.iter_unpack(frames):
                    shown = data[: min(length, 8)].hex(" ")
                    yield time_ns, f"{time_ns / 1e9:.6f} {name} {way} {can_id & 0x1FFFFFFF:03X} {shown}".rstrip()
