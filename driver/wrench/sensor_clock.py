"""A sensor's own 32-bit microsecond counter, brought to the host's time."""

from __future__ import annotations

WRAP_US = 1 << 32
"""The counter starts again after 71.6 minutes."""
DRIFT = 200e-6
"""How far two crystals may run apart; the estimate follows at this rate and no faster."""
TOLERANCE_NS = 500_000_000
"""How much a step of the sensor's clock may differ from the host's: longer than any delivery is held up."""


class SensorClock:
    """Follows one counter: tells whether a reading continues it, unwraps it, and dates it in host time.

    Bytes are late by the line and by the host's own polling, never early: host time minus sensor time is the
    offset plus a delay ≥ 0. The smallest seen so far, allowed to grow with the crystals' drift, is the offset.
    """

    def __init__(self, reading_us: int, now_ns: int) -> None:
        self._reading_us = reading_us
        self._elapsed_ns = 0
        self._now_ns = now_ns
        self._offset_ns = float(now_ns)
        self._offset_at_ns = 0

    def step_ns(self, reading_us: int) -> int:
        """From the last reading to this one, forward across a wrap."""
        return (reading_us - self._reading_us) % WRAP_US * 1000

    def continued_by(self, reading_us: int, now_ns: int) -> bool:
        """Could this be the next reading of the same counter? A counter that stands still could not.

        Whole turns of the counter during a silence are allowed for; a reading from before the last one, as an old
        frame brings it that comes again, is not.
        """
        step = self._elapsed_step_ns(reading_us, now_ns)
        return self.step_ns(reading_us) > 0 and abs(now_ns - self._now_ns - step) < TOLERANCE_NS

    def _elapsed_step_ns(self, reading_us: int, now_ns: int) -> int:
        """The step with the whole turns that the host's time says passed meanwhile; never backwards."""
        step, turn = self.step_ns(reading_us), WRAP_US * 1000
        return step + max(0, round((now_ns - self._now_ns - step) / turn)) * turn

    def advance(self, reading_us: int, now_ns: int, *, newest: bool) -> int:
        """Host time of the reading, ns. ``newest``: the last one of its delivery, which was held up the least."""
        self._elapsed_ns += self._elapsed_step_ns(reading_us, now_ns)
        self._reading_us, self._now_ns = reading_us, now_ns
        if newest:
            grown = self._offset_ns + DRIFT * (self._elapsed_ns - self._offset_at_ns)
            self._offset_ns = min(grown, float(now_ns - self._elapsed_ns))
            self._offset_at_ns = self._elapsed_ns
        return round(self._offset_ns) + self._elapsed_ns
