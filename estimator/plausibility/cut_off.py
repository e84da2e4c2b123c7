"""Channels whose sensor says nothing: cut off at the end of its range, or dead."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Mask = NDArray[np.bool_]

_LEAST_RUN = 5
"""Equal samples in a row at an extreme: sharp peaks of a smooth, noisy channel do not stand so long."""
_LEAST_SAMPLES = 20
_CROWDED = 5.0
"""How much fuller the extreme value itself must be than a band next to it: a slow peak, however coarsely quantised,
crowds its neighbours as well."""
_BAND = 0.02
"""Width of that band, share of the channel's range."""


def cut_off(values: Array) -> Mask:
    """(samples, channels) where a channel stands at a flat top: the sensor or amplifier saturates there.

    ``values`` (samples, channels) as recorded, NaN where missing. A flat top is many samples, some of them in long
    runs, of exactly the channel's largest or smallest value, with few just short of it: what is cut off passes that
    band fast. A channel that rests at its extreme fills the band with its noise and is not taken for it.
    """
    mask = np.zeros(values.shape, dtype=np.bool_)
    for channel, column in enumerate(values.T):
        for sign in (1.0, -1.0):
            mask[:, channel] |= _flat_top(sign * column)
    return mask


def dead(values: Array) -> Mask:
    """(channels,) whether a channel has one value throughout."""
    return np.asarray(np.fmax.reduce(values, axis=0) == np.fmin.reduce(values, axis=0))


def _flat_top(x: Array) -> Mask:
    known = x[np.isfinite(x)]
    if known.size == 0 or known.max() == known.min():
        return np.zeros(len(x), dtype=np.bool_)
    top = float(known.max())
    at_top = x == top
    count = int(np.count_nonzero(at_top))
    if count < _LEAST_SAMPLES or _runs(at_top).max() < _LEAST_RUN:
        return np.zeros(len(x), dtype=np.bool_)
    levels = np.unique(known)
    width = max(_BAND * (top - float(levels[0])), 1.5 * (top - float(levels[-2])))
    below = int(np.count_nonzero((x < top) & (x > top - width)))
    entries = len(_runs(at_top))
    # Even a fast passage leaves a sample or two just short of the top, going in and coming out.
    if count < _CROWDED * max(below - 2 * entries, 1) or not _comes_in_fast(x, at_top):
        return np.zeros(len(x), dtype=np.bool_)
    return np.asarray(at_top)


def _comes_in_fast(x: Array, at_top: Mask) -> bool:
    """Whether the channel moves where it meets the top, and does not settle there like a controller on its goal."""
    meets = np.flatnonzero(at_top[1:] & ~at_top[:-1])
    meets = meets[meets >= 1]
    if not meets.size:
        return False
    first = np.abs(x[meets + 1] - x[meets])
    before = np.abs(x[meets] - x[meets - 1])
    return bool(np.nanmedian(before) > 0.0 and np.nanmedian(first) > 0.1 * np.nanmedian(before))


def _runs(mask: Mask) -> NDArray[np.intp]:
    """Lengths of the runs of true."""
    edges = np.diff(np.concatenate([[0], mask.astype(np.int8), [0]]))
    return np.asarray(np.flatnonzero(edges == -1) - np.flatnonzero(edges == 1))
