"""Angles that leap from one sample to the next, as no joint moves: by whole turns, where an angle is told within one,
or by anything, where the reading is damaged."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import median_filter, uniform_filter1d

Array = NDArray[np.float64]

_TURN = 2.0 * np.pi
_BESIDE = 0.5
"""rad beside a whole number of turns that a joint moves at most from one sample to the next."""
_LEAST = 0.05
"""rad, m; a smaller leap is no worse than an encoder's noise."""
_TREND = 5
"""Samples on either side whose steps say how fast the joint moves."""
_TIMES = 20.0
"""Times what steps usually differ from that a leap is: of a sensor that tells every tenth sample, a step is ten."""
_AROUND = 20
"""Samples on either side whose steps are the usual ones."""
_MARGIN, _FEWEST = 0.02, 4
"""s, and samples, on either side of a leap that are damaged with it: more than what is taken for jitter."""


def turns(angle: Array) -> Array:
    """(samples,) whole turns by which an angle (samples,) rad that is told within one goes on; NaN where it is NaN."""
    told = np.flatnonzero(np.isfinite(angle))
    steps = np.diff(angle[told])
    whole = np.round(steps / _TURN)
    whole[np.abs(steps - _TURN * whole) > _BESIDE] = 0.0
    result = np.full(len(angle), np.nan)
    result[told] = -np.concatenate([np.zeros(min(len(told), 1)), np.cumsum(whole)])
    return result


def leaps(t: Array, angle: Array) -> NDArray[np.intp]:
    """The first sample after each leap of an angle (samples,), rad or m, at times (samples,) s. Whole turns are leaps
    too; over a gap, where a recording is parted anyway, a joint may have moved."""
    if np.count_nonzero(np.isfinite(angle)) < 2 * _AROUND:
        return np.zeros(0, dtype=np.intp)
    told, beside = _beside(t, angle)
    width = 2 * _AROUND + 1
    usual = np.maximum(width * uniform_filter1d(beside, width, mode="reflect") - beside, 0.0) / (width - 1)
    return np.asarray(told[(beside > _LEAST) & (beside > _TIMES * usual)])


def how_far(t: Array, angle: Array, places: NDArray[np.intp]) -> Array:
    """(places,) of an angle's `leaps`, how far each is beside what the samples about it step: a sample that repeats the
    one before it is as far off as the joint moved."""
    told, beside = _beside(t, angle)
    return np.asarray(beside[np.searchsorted(told, places)])


def _beside(t: Array, angle: Array) -> tuple[NDArray[np.intp], Array]:
    """The samples of an angle after the first that is told, and how far the step to each differs from those about
    it."""
    told = np.flatnonzero(np.isfinite(angle))
    apart = np.diff(t[told])
    steps = np.diff(angle[told]) * np.minimum(np.median(apart) / apart, 1.0)
    return told[1:], np.abs(steps - median_filter(steps, 2 * _TREND + 1, mode="reflect"))


def about(t: Array, places: NDArray[np.intp]) -> NDArray[np.bool_]:
    """(samples,) which samples, at times (samples,) s, are damaged with the leaps."""
    result = np.zeros(len(t), dtype=np.bool_)
    for place in places:
        first, last = np.searchsorted(t, [t[place] - _MARGIN, t[place] + _MARGIN])
        result[max(0, min(int(first), place - _FEWEST)) : max(int(last), place + _FEWEST)] = True
    return result
