"""What the loop counts about itself: punctuality, traffic, cost."""

from __future__ import annotations

import time
from collections.abc import Sequence

from config import Installation
from driver.cyclic.exchange import Begun, Exchange
from driver.cyclic.last_frames import LastFrames
from driver.cyclic.lateness import Lateness
from driver.cyclic.slot import Batch, Serial
from driver.cyclic.status import BusStatus


class LoopStatistics:
    """Counts over all cycles; load and cost are means since they were last asked for."""

    def __init__(self, installation: Installation) -> None:
        self._buses = installation.bus
        self.frames = LastFrames(
            [bus.name for bus in installation.bus], [sensor.name for sensor in installation.wrench_sensor]
        )
        self.lateness = Lateness()
        self.cycles = self.missed = self.good = 0
        self._cpu = time.process_time_ns(), 0
        self._traffic = 0, [0] * len(installation.bus)

    def add(
        self,
        begun: Begun,
        batches: Sequence[Batch],
        serial: Sequence[Serial],
        now_ns: int,
        *,
        good: bool,
        complete: bool,
    ) -> None:
        """Count one cycle, whose feedback was there at ``now_ns``. ``good`` feeds the watchdog; ``complete``: on time
        and with all feedback."""
        self.frames.add(batches, serial, now_ns)
        self.lateness.add(begun.late_ns)
        self.cycles += 1 + begun.skipped
        self.missed += begun.skipped + (not complete)
        self.good += good

    def begin_traffic(self, exchange: Exchange) -> None:
        """A new exchange, whose counts begin at zero."""
        self._traffic = exchange.now_ns, [0] * len(self._buses)

    def cpu_us(self) -> float:
        """CPU time of the process a cycle, µs."""
        cpu_ns, cycles = self._cpu
        self._cpu = time.process_time_ns(), self.cycles
        return (self._cpu[0] - cpu_ns) / 1e3 / max(1, self.cycles - cycles)

    def bus_status(self, exchange: Exchange) -> tuple[BusStatus, ...]:
        """Traffic, load and errors of each bus."""
        since_ns, before = self._traffic
        counted = [count.sent + count.received for count in exchange.counts]
        self._traffic = exchange.now_ns, counted
        elapsed_s = max(1, exchange.now_ns - since_ns) / 1e9
        return tuple(
            BusStatus(
                bus.name,
                count.sent,
                count.received,
                (frames - earlier) * self.frames.bits_per_frame(k) / bus.bitrate / elapsed_s,
                count.errors,
            )
            for k, (bus, count, frames, earlier) in enumerate(
                zip(self._buses, exchange.counts, counted, before, strict=True)
            )
        )
