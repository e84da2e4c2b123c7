"""What each candidate would add to a model that already has some unknowns: Schur complements of the Gram matrices."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs

from estimator.diagnosis.bounded import bounded_gains
from estimator.diagnosis.design import Candidate, Design
from estimator.diagnosis.grams import Block

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_RIDGE = 1e-12
"""On the normalised diagonal: an unknown that two columns share is shared between them."""


@dataclass(frozen=True)
class Group:
    """Candidates with the same number of coefficients, treated at once."""

    candidates: Indices
    columns: Indices
    """(k, c)"""
    lower: Array
    upper: Array


def groups_of(design: Design, candidates: Indices | None = None) -> list[Group]:
    """All candidates, or some, by their number of coefficients."""
    by_count: dict[int, list[int]] = defaultdict(list)
    for k in range(len(design.candidates)) if candidates is None else candidates:
        by_count[len(design.candidates[k].columns)].append(int(k))
    result = []
    for members in by_count.values():
        chosen = [design.candidates[k] for k in members]
        result.append(
            Group(
                np.array(members),
                np.array([c.columns for c in chosen]),
                np.array([c.lower for c in chosen]),
                np.array([c.upper for c in chosen]),
            )
        )
    return result


def products(design: Design, block: Block, weights: Array, first: Indices, second: Indices) -> Array:
    """(first, second) weighted products of some unknowns' columns with others', over all channels."""
    result = np.zeros((len(first), len(second)))
    one, other = design.position[:, first], design.position[:, second]
    enters, meets = one >= 0, other >= 0
    for channel in np.flatnonzero(enters.any(axis=1) & meets.any(axis=1)):
        rows, columns = np.flatnonzero(enters[channel]), np.flatnonzero(meets[channel])
        gram = block.grams[channel]
        result[rows[:, None], columns] += weights[channel] * gram[one[channel, rows, None], other[channel, columns]]
    return result


class Conditional:
    """The model with the ``active`` unknowns fitted to one block (or sum) with a weight for each channel.

    The prior of the base parameters counts in full whatever the block.
    """

    def __init__(self, design: Design, block: Block, weights: Array, active: Indices) -> None:
        self.design, self.block, self.weights, self.active = design, block, weights, active
        size, given = design.size, design.given
        self.right = np.zeros(size)
        for channel, gram in enumerate(block.grams):
            self.right[design.members[channel]] += weights[channel] * gram[:-1, -1]
        matrix = products(design, block, weights, active, active)
        matrix[:given, :given] += design.precision
        diagonal = np.diag(matrix)
        scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        # An unknown without any effect here stays zero.
        normal = matrix / np.outer(scale, scale) + np.diag(np.where(diagonal > 0.0, _RIDGE, 1.0))
        # LAPACK itself: a model of a few dozen unknowns is solved in less time than a wrapper looks at its arguments.
        factor, failed = dpotrf(normal.T, overwrite_a=True)
        if failed:
            raise np.linalg.LinAlgError(f"normal matrix is not positive definite at unknown {failed}")

        def solve(right: Array) -> Array:
            return np.asarray((dpotrs(factor, (right.T / scale).T)[0].T / scale).T)

        self.solve = solve
        self.value: Array = solve(self.right[active])

    @cached_property
    def cross(self) -> Array:
        """(active, size) products of the active unknowns' columns with all."""
        result = np.zeros((len(self.active), self.design.size))
        for channel, gram in enumerate(self.block.grams):
            members, place = self.design.members[channel], self.design.position[channel][self.active]
            enters = np.flatnonzero(place >= 0)
            result[enters[:, None], members] += self.weights[channel] * gram[place[enters], :-1]
        return result

    @cached_property
    def covariance(self) -> Array:
        """(active, active) of the active unknowns."""
        return self.solve(np.eye(len(self.active)))

    @cached_property
    def projected(self) -> Array:
        """(active, size): every column in terms of the active ones."""
        return self.solve(self.cross)

    @cached_property
    def score(self) -> Array:
        """(size,) products of every column with the residual."""
        return np.asarray(self.right - self.cross.T @ self.value)

    def left_of(self, columns: Indices) -> tuple[Array, Array, Array]:
        """(c, c) products of some columns after the active ones, (c,) those with the residual, (c,) energies before."""
        whole = products(self.design, self.block, self.weights, columns, columns)
        cross = products(self.design, self.block, self.weights, self.active, columns)
        energy = np.diag(whole).copy()
        return whole - cross.T @ self.solve(cross), self.right[columns] - cross.T @ self.value, energy

    def squares(self) -> Array:
        """(channels,) squared residual, not weighted."""
        return self.squares_with(self.active, self.value)

    def squares_with(self, unknowns: Indices, value: Array, block: Block | None = None) -> Array:
        """(channels,) squared residual at given values of some unknowns, the others zero; on another block if given."""
        result = np.empty(len(self.design.channels))
        for channel, gram in enumerate((block or self.block).grams):
            place = self.design.position[channel][unknowns]
            enters = place >= 0
            direction = np.append(-value[enters], 1.0)
            chosen = np.append(place[enters], len(gram) - 1)
            result[channel] = direction @ gram[chosen[:, None], chosen] @ direction
        return result

    def remaining(self, group: Group) -> tuple[Array, Array]:
        """(k, c, c) products of each candidate's columns after the active ones, and (k, c) energies before."""
        k, c = group.columns.shape
        matrix = np.zeros((k, c, c))
        for channel, gram in enumerate(self.block.grams):
            place = self.design.position[channel][group.columns]
            enters = place[:, 0] >= 0
            inside = place[enters]
            matrix[enters] += self.weights[channel] * gram[inside[:, :, None], inside[:, None, :]]
        energy = np.einsum("kcc->kc", matrix).copy()
        columns = group.columns.ravel()
        cross = self.cross[:, columns].reshape(-1, k, c)
        projected = self.projected[:, columns].reshape(-1, k, c)
        matrix -= cross.transpose(1, 2, 0) @ projected.transpose(1, 0, 2)
        return matrix, energy

    def gains(self, groups: list[Group]) -> Array:
        """(candidates,) log-likelihood gained by each candidate of the groups; others −inf."""
        result = np.full(len(self.design.candidates), -np.inf)
        for group in groups:
            matrix, energy = self.remaining(group)
            score = self.score[group.columns][:, :, None]
            result[group.candidates] = bounded_gains(matrix, score, energy, group.lower, group.upper)[:, 0]
        return result


def within_limits(
    design: Design, block: Block, weights: Array, candidates: Sequence[Candidate], least: int = 0
) -> Conditional:
    """The given model with ``candidates``, fitted without coefficients that would be negative and cannot be, or
    positive: those are zero. The one farthest beyond, in its standard errors, goes first, as long as its candidate
    keeps ``least`` coefficients. Where some must be kept, only what is `Candidate.separable` goes.
    """
    owner = np.repeat(np.arange(len(candidates)), [len(c.columns) for c in candidates])
    columns = np.concatenate([np.zeros(0, dtype=np.intp), *(c.columns for c in candidates)])
    signs = [np.where(c.lower == 0.0, 1.0, np.where(c.upper == 0.0, -1.0, 0.0)) for c in candidates]
    may_go = [c.separable if least else np.ones(len(c.columns)) for c in candidates]
    sign = np.concatenate([np.zeros(0), *(own * free for own, free in zip(signs, may_go, strict=True))])
    kept = np.ones(len(columns), dtype=bool)
    while True:
        model = Conditional(design, block, weights, np.concatenate([np.arange(design.given), columns[kept]]))
        inside = np.zeros(len(columns))
        inside[kept] = sign[kept] * model.value[design.given :]
        beyond = (inside < 0.0) & (np.bincount(owner[kept], minlength=len(candidates))[owner] > least)
        if not beyond.any():
            return model
        error = np.ones(len(columns))
        error[kept] = np.sqrt(np.diag(model.covariance)[design.given :])
        kept[np.argmin(np.where(beyond, inside / error, 0.0))] = False
