"""Changes that are not to be learnt: another load, a slow drift."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from learner.cosine_spectrum import smoothed_power
from learner.trial_filter import Surprise

Array = NDArray[np.float64]
FALSE_ALARM = 1e-4
"""Probability a joint and trial."""
LOOKED_AT_HZ = 20.0
"""Loads and friction change what lies below; above, lines are many and carry mostly noise."""
LEAST_RATIO = 3.0
"""However many lines there are: the noise's own spectrum is known no better than this."""
TELLING = 0.25
"""Of the power of what the model lacked: half its size, by which a trial may differ without another arm being meant."""
CORRELATED = 0.5
"""Of two successive innovations, from which on a drift is spoken of."""


@dataclass(frozen=True)
class Change:
    """``ratio``: (n,) power of the innovation over what was expected; ``bound``: what chance would reach."""

    ratio: Array
    bound: float
    changed: NDArray[np.bool_]
    drifting: NDArray[np.bool_]


class ChangeWatch:
    """Compares each trial with what was expected of it, and with the trial before.

    ``correction`` (lines × n): what the model lacked before practice. Friction and ripple answer to the slightest
    change of the motion; only what differs by more than the model lacked then is called another arm.
    """

    def __init__(self, frequency: Array, replays: int, band_hz: float, correction: Array) -> None:
        self._lacked = TELLING * smoothed_power(correction**2)
        self._lines = frequency <= min(LOOKED_AT_HZ, band_hz)
        count = max(1, int(self._lines.sum()))
        # Noise that is stronger where the arm is faster correlates neighbouring lines: half of them count.
        freedom = max(1.0, count / 2.0)
        self.bound = max(LEAST_RATIO, float(fisher.isf(FALSE_ALARM, freedom, freedom * (replays - 1))))
        self._chance = 4.0 / np.sqrt(freedom)
        self._before: Array | None = None

    def look(self, surprise: Surprise) -> Change:
        """Judge one trial's surprise."""
        normal = (surprise.innovation / np.sqrt(surprise.variance))[self._lines]
        tolerated = (surprise.innovation**2 / (surprise.variance + self._lacked))[self._lines]
        ratio = np.mean(tolerated, axis=0)
        changed = ratio > self.bound
        drifting = np.zeros_like(changed)
        if self._before is not None:
            length = np.linalg.norm(normal, axis=0) * np.linalg.norm(self._before, axis=0)
            alike = np.sum(normal * self._before, axis=0) / np.maximum(length, np.finfo(float).tiny)
            drifting = (alike > max(CORRELATED, self._chance)) & ~changed
        self._before = None if changed.any() else normal
        return Change(ratio, self.bound, changed, drifting)
