"""Counts of how late the loop woke up."""

from __future__ import annotations

from bisect import bisect_left

from driver.cyclic.status import LATENESS_EDGES_US

EDGES_NS = tuple(edge * 1000 for edge in LATENESS_EDGES_US)


class Lateness:
    """Histogram of wake-up lateness over `LATENESS_EDGES_US`."""

    def __init__(self) -> None:
        self.counts = [0] * (len(EDGES_NS) + 1)
        self.worst_ns = 0

    def add(self, late_ns: int) -> None:
        self.counts[bisect_left(EDGES_NS, late_ns)] += 1
        if late_ns > self.worst_ns:
            self.worst_ns = late_ns
