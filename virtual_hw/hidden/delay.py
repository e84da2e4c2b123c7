"""A transport delay of any length on one channel: y(t) = x(t − delay), interpolated between samples."""

from __future__ import annotations


class DelayLine:
    """Delays samples that arrive every ``period_s`` by ``delay_s``; before the first one it holds ``initial``."""

    __slots__ = ("_fraction", "_index", "_line")

    def __init__(self, delay_s: float, period_s: float, initial: float) -> None:
        whole = int(delay_s / period_s + 1e-9)
        self._fraction = max(0.0, delay_s / period_s - whole)
        self._line = [initial] * (whole + 2)
        self._index = 0

    def push(self, value: float) -> float:
        """Take this period's sample, give the delayed one."""
        line, k = self._line, self._index
        line[k] = value
        k += 1
        if k == len(line):
            k = 0
        self._index = k
        # After the write, k is the oldest sample (whole + 1 periods old) and k + 1 the next older-but-one.
        newer = line[k + 1 - len(line)]
        return newer + self._fraction * (line[k] - newer)
