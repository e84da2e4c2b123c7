"""What each candidate would add to a model that already has some unknowns: Schur complements of the Gram matrices."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg.lapack import dpotrf, dpotrs, dtrtrs

from estimator.diagnosis.evidence.bounded import bounded_gains
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_RIDGE = 1e-12
"""On the normalised diagonal: an unknown that two columns share is shared between them."""


@dataclass(frozen=True)
class Group:
    """Candidates with the same number of coefficients, of which the same have a sign, treated at once."""

    candidates: Indices
    columns: Indices
    """(k, c)"""
    lower: Array
    upper: Array


def groups_of(design: Design, candidates: Sequence[int] | Indices | None = None) -> list[Group]:
    """All candidates, or some, by their coefficients."""
    alike: dict[tuple[bool, ...], list[int]] = defaultdict(list)
    for k in range(len(design.candidates)) if candidates is None else candidates:
        own = design.candidates[k]
        alike[tuple((own.lower == 0.0) | (own.upper == 0.0))].append(int(k))
    result = []
    for members in alike.values():
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


class Conditional:
    """The model with the ``active`` unknowns, the given model's first, fitted to what was `told`.

    The prior of the base parameters counts in full whatever the block.
    """

    def __init__(self, told: Weighted, active: Indices) -> None:
        self.told, self.design, self.active = told, told.design, active
        given = self.design.given
        self.right = told.with_residual
        matrix = told.of_active(active, active)
        matrix[:given, :given] += self.design.precision
        diagonal = np.diag(matrix)
        scale = np.sqrt(np.where(diagonal > 0.0, diagonal, 1.0))
        # An unknown without any effect here stays zero.
        normal = matrix / np.outer(scale, scale) + np.diag(np.where(diagonal > 0.0, _RIDGE, 1.0))
        # LAPACK itself: a model of a few dozen unknowns is solved in less time than a wrapper looks at its arguments.
        factor, failed = dpotrf(normal.T, overwrite_a=True)
        if failed:
            raise np.linalg.LinAlgError(f"normal matrix is not positive definite at unknown {failed}")
        self._root = factor * scale
        """Upper triangular R of the normal matrix RᵀR."""
        self.value: Array = self.solve(self.right[active])

    @property
    def explained(self) -> float:
        """nats that the active unknowns explain."""
        return 0.5 * float(self.right[self.active] @ self.value)

    @property
    def log_evidence(self) -> float:
        """log p(rows) with the active unknowns integrated out, those of the given model over their prior and the others
        over all that they can be: up to what depends on the rows and on the others' columns alone."""
        narrowed = 2.0 * np.sum(np.log(np.diag(self._root))) - np.linalg.slogdet(self.design.precision)[1]
        return self.explained - 0.5 * float(narrowed)

    def solve(self, right: Array) -> Array:
        """(active, …) the unknowns for other right-hand sides."""
        return np.asarray(dpotrs(self._root, right)[0])

    def halfway(self, right: Array) -> Array:
        """(active, …) R⁻ᵀ of right-hand sides: the products of two such are those that the active unknowns explain."""
        return np.asarray(dtrtrs(self._root, right, trans=1)[0])

    @cached_property
    def rooted(self) -> Array:
        """(size, active): `halfway` of every column's products with the active ones."""
        given = self.design.given
        cross = np.concatenate([self.told.of_given, self.told.with_all(self.active[given:])])
        return np.asarray(dtrtrs(self._root, np.asfortranarray(cross), trans=1, overwrite_b=True)[0].T)

    @cached_property
    def covariance(self) -> Array:
        """(active, active) of the active unknowns."""
        return self.solve(np.eye(len(self.active)))

    def covariance_of_causes(self) -> Array:
        """(causes, causes) of the active unknowns that are not the given model's: they come last, so their part of the
        root is of them alone."""
        own = self._root[self.design.given :, self.design.given :]
        half = dtrtrs(own, np.eye(len(own)), trans=1)[0]
        return np.asarray(half.T @ half)

    @cached_property
    def score(self) -> Array:
        """(size,) products of every column with the residual."""
        return np.asarray(self.right - self.rooted @ self.halfway(self.right[self.active]))

    def left_of(self, columns: Indices) -> tuple[Array, Array, Array]:
        """(c, c) products of some columns after the active ones, (c,) those with the residual, (c,) energies before."""
        whole = self.told.products(columns, columns)
        cross = self.told.of_active(self.active, columns)
        energy = np.diag(whole).copy()
        half = self.halfway(cross)
        return whole - half.T @ half, self.right[columns] - cross.T @ self.value, energy

    def squares(self) -> Array:
        """(channels,) squared residual, not weighted."""
        return self.squares_with(self.active, self.value)

    def squares_with(self, unknowns: Indices, value: Array, block: Block | None = None) -> Array:
        """(channels,) squared residual at given values of some unknowns, the others zero; on another block if given."""
        result = np.empty(len(self.design.channels))
        for channel, gram in enumerate((block or self.told.block).grams):
            place = self.design.position[channel][unknowns]
            enters = place >= 0
            direction = np.append(-value[enters], 1.0)
            chosen = np.append(place[enters], len(gram) - 1)
            result[channel] = direction @ gram[chosen[:, None], chosen] @ direction
        return result

    def remaining(self, group: Group, own: Array | None = None, half: Array | None = None) -> tuple[Array, Array]:
        """(k, c, c) products of each candidate's columns after the active ones, and (k, c) energies before; ``own``
        (k, c, c) of its own columns (`Weighted.of_each`), and ``half`` (k, c, active) of them (`rooted`), where they
        are known."""
        if own is None:
            own = self.told.of_each(group.columns)
        if half is None:
            half = self.rooted[group.columns]
        return own - half @ half.transpose(0, 2, 1), np.einsum("kcc->kc", own)

    def gains(self, groups: Sequence[Group], own: Sequence[Array] | None = None) -> Array:
        """(candidates,) log-likelihood gained by each candidate of the groups; others −inf. ``own`` of each group as
        `remaining` takes it."""
        result = np.full(len(self.design.candidates), -np.inf)
        for number, group in enumerate(groups):
            matrix, energy = self.remaining(group, None if own is None else own[number])
            score = self.score[group.columns][:, :, None]
            result[group.candidates] = bounded_gains(matrix, score, energy, group.lower, group.upper)[:, 0]
        return result

    def gains_of_few(self, groups: Sequence[Group]) -> Array:
        """`gains` of candidates that are few beside all: no other column is touched."""
        result, told = np.full(len(self.design.candidates), -np.inf), self.halfway(self.right[self.active])
        for group in groups:
            cross = self.told.of_active(self.active, group.columns.ravel())
            half = self.halfway(cross).T.reshape(*group.columns.shape, len(self.active))
            matrix, energy = self.remaining(group, half=half)
            score = (self.right[group.columns] - half @ told)[:, :, None]
            result[group.candidates] = bounded_gains(matrix, score, energy, group.lower, group.upper)[:, 0]
        return result


def within_limits(told: Weighted, candidates: Sequence[Candidate], least: int = 0) -> Conditional:
    """The given model with ``candidates``, fitted without coefficients that would be negative and cannot be, or
    positive: those are zero. The one farthest beyond, in its standard errors, goes first, as long as its candidate
    keeps ``least`` coefficients. Where some must be kept, only what is `Candidate.separable` goes.
    """
    given = told.design.given
    owner = np.repeat(np.arange(len(candidates)), [len(c.columns) for c in candidates])
    columns = np.concatenate([np.zeros(0, dtype=np.intp), *(c.columns for c in candidates)])
    signs = [np.where(c.lower == 0.0, 1.0, np.where(c.upper == 0.0, -1.0, 0.0)) for c in candidates]
    may_go = [c.separable if least else np.ones(len(c.columns)) for c in candidates]
    sign = np.concatenate([np.zeros(0), *(own * free for own, free in zip(signs, may_go, strict=True))])
    kept = np.ones(len(columns), dtype=bool)
    model = Conditional(told, np.concatenate([np.arange(given), columns]))
    if not (sign * model.value[given:] < 0.0).any():
        return model
    value, covariance = model.value[given:].copy(), model.covariance_of_causes()
    while True:
        inside = np.where(kept, sign * value, 0.0)
        beyond = (inside < 0.0) & (np.bincount(owner[kept], minlength=len(candidates))[owner] > least)
        if not beyond.any():
            break
        error = np.sqrt(np.where(kept, np.diag(covariance), 1.0))
        gone = np.argmin(np.where(beyond, inside / error, 0.0))
        # What the others are without it: as they are where it is known to be zero.
        pull = covariance[:, gone] / covariance[gone, gone]
        value -= pull * value[gone]
        covariance -= np.outer(pull, covariance[gone])
        kept[gone] = False
    return model if kept.all() else Conditional(told, np.concatenate([np.arange(given), columns[kept]]))
