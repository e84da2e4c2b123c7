"""Histories by time and frequency: overlapping sections, each by its cosine spectrum.

What an arm still has to learn lies at a few moments, where friction lets go and catches; noise lies everywhere. One
spectrum of the whole motion cannot tell the two apart, and would believe the noise of a whole trial for the sake of
those moments.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from learner.cosine_spectrum import frequencies, to_history, to_lines

Array = NDArray[np.float64]
SECTION_S = 0.5
"""Length of a section; two of them overlap everywhere."""


class Sections:
    """Of histories of ``samples`` samples, every ``period`` s.

    The windows' squares sum to one: lines and back gives the history, and white noise of variance v lines whose
    variances, weighted as in `whole`, are v.
    """

    def __init__(self, samples: int, period: float) -> None:
        self._samples = samples
        self._steps = max(1, round(2.0 * samples * period / SECTION_S))
        self._step = -(-samples // self._steps)
        self._window = np.sin(np.pi * (np.arange(2 * self._step) + 0.5) / (2 * self._step))[:, None]
        self._whole = frequencies(samples, period)
        self.frequency = frequencies(2 * self._step, period)
        """(lines,) Hz of each section."""

    def lines(self, history: Array) -> Array:
        """(sections, lines, n) of a history (samples, n), which is reflected at its ends."""
        after = (self._steps + 1) * self._step - self._samples
        whole = np.pad(history, ((self._step, after), (0, 0)), mode="symmetric")
        parts = [whole[k * self._step : (k + 2) * self._step] for k in range(self._steps + 1)]
        return np.stack([to_lines(self._window * part) for part in parts])

    def history(self, lines: Array) -> Array:
        """(samples, n): back from `lines`."""
        whole = np.zeros(((self._steps + 2) * self._step, lines.shape[2]))
        for k, part in enumerate(lines):
            whole[k * self._step : (k + 2) * self._step] += self._window * to_history(part)
        return whole[self._step : self._step + self._samples]

    def whole(self, variance: Array) -> Array:
        """(samples, n): variances of the lines of the whole history, from those of the sections' lines."""
        total = 2.0 * variance.mean(axis=0)  # a window's mean square is one half
        return np.column_stack([np.interp(self._whole, self.frequency, column) for column in total.T])
