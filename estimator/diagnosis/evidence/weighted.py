"""The products of a design's columns over one block, summed over its channels: what any model of some of them needs."""

from __future__ import annotations

from functools import cached_property

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.grams import Block

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


class Weighted:
    """One block (or sum) with a weight for each channel."""

    def __init__(self, design: Design, block: Block, weights: Array) -> None:
        self.design, self.block, self.weights = design, block, weights

    def believed(self, precision: Array) -> Weighted:
        """The same with the given model known to another precision: no product changes."""
        other = Weighted(self.design.believed(precision), self.block, self.weights)
        kept = ("with_residual", "of_given")
        other.__dict__.update({name: x for name, x in self.__dict__.items() if name in kept})
        return other

    @cached_property
    def with_residual(self) -> Array:
        """(size,) of every column with the residual."""
        result = np.zeros(self.design.size)
        for channel, gram in enumerate(self.block.grams):
            result[self.design.members[channel]] += self.weights[channel] * gram[:-1, -1]
        return result

    @cached_property
    def of_given(self) -> Array:
        """(given, size) of the given model's columns with all."""
        return self.with_all(np.arange(self.design.given))

    def with_all(self, columns: Indices) -> Array:
        """(k, size) of some columns with all."""
        result = np.zeros((len(columns), self.design.size))
        for channel, gram in enumerate(self.block.grams):
            place = self.design.position[channel][columns]
            enters = (place >= 0).nonzero()[0]
            if len(enters):
                members = self.design.members[channel]
                result[enters[:, None], members] += self.weights[channel] * gram[place[enters], :-1]
        return result

    def products(self, first: Indices, second: Indices) -> Array:
        """(first, second) of some columns with others."""
        result = np.zeros((len(first), len(second)))
        one, other = self.design.position[:, first], self.design.position[:, second]
        enters, meets = one >= 0, other >= 0
        for channel in np.flatnonzero(enters.any(axis=1) & meets.any(axis=1)):
            rows, columns = enters[channel].nonzero()[0], meets[channel].nonzero()[0]
            gram = self.block.grams[channel][one[channel, rows, None], other[channel, columns]]
            result[rows[:, None], columns] += self.weights[channel] * gram
        return result

    def of_active(self, active: Indices, columns: Indices) -> Array:
        """(active, columns) of the given model's columns and some more, ``active`` in this order, with others."""
        given = self.design.given
        return np.concatenate([self.of_given[:, columns], self.products(active[given:], columns)])

    def of_each(self, columns: Indices) -> Array:
        """(k, c, c) of each candidate's own columns (k, c) with each other."""
        k, c = columns.shape
        result = np.zeros((k, c, c))
        for channel, gram in enumerate(self.block.grams):
            place = self.design.position[channel][columns]
            enters = (place[:, 0] >= 0).nonzero()[0]
            inside = place[enters]
            result[enters] += self.weights[channel] * gram[inside[:, :, None], inside[:, None, :]]
        return result
