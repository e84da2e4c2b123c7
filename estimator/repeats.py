"""The same motion again, and what it tells: two playings differ by noise alone, whatever the arm's model lacks.

Their differences are the noise of a channel without any model of the arm. What an identified model leaves beyond it is
lack of fit; what it leaves below it cannot be explained by anything.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cache

import numpy as np
from numpy.typing import NDArray
from scipy.sparse import csr_array

from estimator.recurrence import SEARCH_RATE, RecurrenceSearch, averaged
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_SINC_REACH = 24
"""Samples either side by which a channel is shifted a fraction of a sample: exact to 0.85 of half the rate."""
_SINC_WINDOW = 6.0
"""Shape of its Kaiser window."""
_EVEN = 0.05
"""Of a period, by which a sample may be off an even grid: with more, the channel is interpolated linearly."""
_ON_GRID = 0.01
"""Of a sample: a shift that makes no difference."""


@dataclass(frozen=True)
class Occurrence:
    """One playing: which trajectory, and when it begins there (s, in the trajectory's own time)."""

    trajectory: int
    start: float


@dataclass(frozen=True)
class RepeatGroup:
    """Playings of one motion that do not overlap; the first is the reference."""

    occurrences: tuple[Occurrence, ...]
    duration: float
    """s, of each playing."""
    mismatch: Array
    """(n,) rms difference of the angles between the playings and the reference, rad."""


def find_repeats(trajectories: Sequence[Trajectory]) -> list[RepeatGroup]:
    """Groups of two or more playings of the same motion; empty where no motion recurs.

    Times of the trajectories need no common origin, rates may differ, a gap ends a passage. What is at rest is no
    motion. Each stretch belongs to one group at most.
    """
    pieces = averaged(trajectories)
    if not pieces:
        return []
    return [
        RepeatGroup(
            tuple(
                Occurrence(pieces[piece].trajectory, pieces[piece].origin + start / SEARCH_RATE)
                for piece, start in passage.starts
            ),
            (passage.length - 1) / SEARCH_RATE,
            passage.mismatch,
        )
        for passage in RecurrenceSearch(pieces).passages()
    ]


def aligned(group: RepeatGroup, times: Sequence[Array], values: Sequence[Array]) -> tuple[float, Array]:
    """Rate (Hz) and values (playings, samples, n) of a channel over the playings of one motion, laid on each other.

    ``times[k]`` (samples,) s and ``values[k]`` (samples, n) are those of trajectory k; the channel may be a measured
    one, or a residual that exists on other samples. Take a residual of any reasonable model rather than the torque
    itself where the playings' motions differ a little (`RepeatGroup.mismatch`): what the model makes of that difference
    is then no noise, and what it lacks cancels. Evenly sampled channels are shifted by parts of a sample with their
    band kept, so that the noise is not smoothed away; jittered ones are interpolated linearly. Samples that some
    playing lacks are cut off the ends.
    """
    reference = times[group.occurrences[0].trajectory]
    rate = float(1.0 / np.median(np.diff(reference)))
    rows: list[tuple[int, Array]] = []
    for occurrence in group.occurrences:
        t, x = times[occurrence.trajectory], values[occurrence.trajectory]
        rows.append(_from(t, x, occurrence.start, rate, group.duration))
    first = max(lost for lost, _ in rows)
    last = min(lost + len(x) for lost, x in rows)
    if last - first < 2:
        return rate, np.empty((len(rows), 0, values[0].shape[1]))
    return rate, np.stack([x[first - lost : last - lost] for lost, x in rows])


def _from(t: Array, x: Array, start: float, rate: float, duration: float) -> tuple[int, Array]:
    """Values at start, start + 1/rate, … as far as they are there; and how many are lacking before the first."""
    wanted = start + np.arange(int(duration * rate) + 1) / rate
    near = slice(*np.searchsorted(t, wanted[[0, -1]] + np.array([-1.0, 1.0]) * (_SINC_REACH + 2) / rate))
    whole = np.isfinite(x[near]).all(axis=1)
    t, x = t[near][whole], x[near][whole]
    if len(t) < 2:
        return len(wanted), np.empty((0, x.shape[1]))
    # Its own period: two recorders' clocks drift by parts of a sample over a motion.
    period = (t[-1] - t[0]) / (len(t) - 1)
    place = (wanted - t[0]) / period
    if np.abs(t - t[0] - period * np.arange(len(t))).max() > _EVEN * period:
        inside = (place >= 0.0) & (place <= len(t) - 1.0)
        return _lost(inside), np.array([np.interp(wanted[inside], t, column) for column in x.T]).T
    nearest = np.rint(place).astype(np.intp)
    on_grid = np.abs(place - nearest).max() < _ON_GRID
    reach = 0 if on_grid else _SINC_REACH
    inside = (nearest >= reach) & (nearest < len(t) - reach)
    return _lost(inside), x[nearest[inside]] if on_grid else _between(x, place[inside])


def _lost(inside: NDArray[np.bool_]) -> int:
    return int(np.argmax(inside)) if inside.any() else len(inside)


def _between(x: Array, place: Array) -> Array:
    """Values at each ``place`` (k,), in samples, all of whose neighbours are in reach."""
    nearest = np.rint(place).astype(np.intp)
    kernels, half = _kernels(), round(0.5 / _ON_GRID)
    own = kernels[half + np.rint((place - nearest) / _ON_GRID).astype(np.intp)]
    neighbours = nearest[:, None] + np.arange(-_SINC_REACH, _SINC_REACH + 1)
    edges = np.arange(0, own.size + 1, own.shape[1])
    return np.asarray(csr_array((own.ravel(), neighbours.ravel(), edges), shape=(len(place), len(x))) @ x)


@cache
def _kernels() -> Array:
    """(fractions, 2·reach + 1) of what a value is made −½ … ½ of a sample beyond one: a sinc under a Kaiser window."""
    fractions = np.arange(-round(0.5 / _ON_GRID), round(0.5 / _ON_GRID) + 1) * _ON_GRID
    offset = np.arange(-_SINC_REACH, _SINC_REACH + 1) - fractions[:, None]
    window = np.i0(_SINC_WINDOW * np.sqrt(1.0 - (offset / (_SINC_REACH + 1.0)) ** 2)) / np.i0(_SINC_WINDOW)
    return np.asarray(np.sinc(offset) * window)
