"""Sums that merge: all that estimation needs of any length of data, as Gram matrices of decimated rows.

One joint's rows are [columns | torque | instruments]; kept are their products at equal times and at a few lags, so
that a spectral weight (whitening of coloured noise) can be applied later without the data. Rows are summed in a few
batches of neighbouring rows, from which errors are taken; when there are too many, neighbours merge, so memory stays
flat. Sums of several recordings add up in any order.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, field
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

LAGS = 5
"""Lags 0 … 4: enough for an autoregressive noise model of order four."""
_MOST_BATCHES = 40
_LEAST_ROWS = 8
"""Rows of the smallest batch: several correlation times, as decimated noise is all but white."""


@dataclass
class Batch:
    """Neighbouring rows of one recording. ``lagged[i]`` is (LAGS, c_i, c_i) for joint i; lags > 0 are D + Dᵀ."""

    rows: int
    recording: int
    lagged: list[Array]
    counted: Array
    """(n,) rows by their squared weight: of a joint that rests for a while, fewer than ``rows``."""

    def absorb(self, other: Batch) -> None:
        self.rows += other.rows
        self.counted = self.counted + other.counted
        for mine, theirs in zip(self.lagged, other.lagged, strict=True):
            mine += theirs


@dataclass
class Sums:
    """Sums of everything added so far."""

    batches: list[Batch] = field(default_factory=list)
    samples: int = 0
    """Samples of the recordings that went into rows."""
    duration: float = 0.0
    """s"""
    high_frequency: Array | None = None
    """(n,) N·m: sum of squares of the torque above the band, scaled to the band's width; see `estimator.rows`."""

    @property
    def rows(self) -> int:
        """Decimated rows a joint."""
        return sum(batch.rows for batch in self.batches)

    @property
    def counted(self) -> Array:
        """(n,) rows of each joint by their squared weight."""
        return np.asarray(np.sum([batch.counted for batch in self.batches], axis=0))

    def add(self, rows: Sequence[Array], recording: int, counted: Array | None = None) -> None:
        """Rows of one segment: for each joint an array (c_i, rows) on the decimated grid, and (n, rows) squared weights
        with which they were made; without them all count fully."""
        count = rows[0].shape[1]
        weights = np.ones((len(rows), count)) if counted is None else counted
        pieces = int(np.clip(count // _LEAST_ROWS, 1, 10))
        edges = np.linspace(0, count, pieces + 1).astype(int)
        for begin, end in pairwise(edges):
            products = [lagged_products(x, begin, end) for x in rows]
            self.batches.append(Batch(int(end - begin), recording, products, weights[:, begin:end].sum(axis=1)))
        self._thin()

    def merge(self, other: Sums) -> None:
        """Takes in another's sums of the same columns; its recordings count as others than one's own."""
        offset = 1 + max((batch.recording for batch in self.batches), default=-1)
        for batch in other.batches:
            lagged = [x.copy() for x in batch.lagged]
            self.batches.append(Batch(batch.rows, batch.recording + offset, lagged, batch.counted.copy()))
        self.samples += other.samples
        self.duration += other.duration
        if other.high_frequency is not None:
            self.high_frequency = other.high_frequency + (0.0 if self.high_frequency is None else self.high_frequency)
        self._thin()

    def _thin(self) -> None:
        """Merges the neighbours that are smallest together, those of one recording first."""
        while len(self.batches) > _MOST_BATCHES:
            costs = [
                (a.recording != b.recording, a.rows + b.rows, k) for k, (a, b) in enumerate(pairwise(self.batches))
            ]
            k = min(costs)[2]
            self.batches[k].absorb(self.batches.pop(k + 1))


def lagged_products(rows: Array, begin: int, end: int) -> Array:
    """Products of rows begin … end with rows up to LAGS − 1 later; zero beyond the segment's end."""
    width, count = rows.shape
    later = np.zeros((LAGS, width, end - begin))
    for lag in range(LAGS):
        stop = max(begin + lag, min(end + lag, count))
        later[lag, :, : stop - begin - lag] = rows[:, begin + lag : stop]
    # One product for all lags.
    result = (later.reshape(LAGS * width, -1) @ rows[:, begin:end].T).reshape(LAGS, width, width)
    result[1:] += result[1:].swapaxes(1, 2).copy()
    return result
