"""Normal equations from sums: assembled joint by joint with weights, solved, with errors from how batches disagree."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.rows import Layout
from estimator.sums import LAGS, Batch, Sums

Array = NDArray[np.float64]


_LEAST_LEFT = 1e-3
"""Of a batch's leverage, what is left to the others at least: what one batch alone tells has a large error."""


@dataclass(frozen=True)
class NormalEquations:
    """Per batch: ``matrix`` (batches, P, P) · unknowns = ``right`` (batches, P). Symmetric without instruments.

    ``prior_matrix`` (P, P) and ``prior_right`` (P,) are what was known beforehand, the same whichever batches count.
    """

    matrix: Array
    right: Array
    prior_matrix: Array
    prior_right: Array

    @property
    def total(self) -> Array:
        """(P, P)"""
        return np.asarray(self.matrix.sum(axis=0) + self.prior_matrix)

    @property
    def total_right(self) -> Array:
        """(P,)"""
        return np.asarray(self.right.sum(axis=0) + self.prior_right)

    def of(self, chosen: list[int]) -> NormalEquations:
        """The same for some of the unknowns, the others being zero."""
        square = np.ix_(chosen, chosen)
        return NormalEquations(
            self.matrix[:, chosen][:, :, chosen],
            self.right[:, chosen],
            self.prior_matrix[square],
            self.prior_right[chosen],
        )

    def with_prior(self, precision: Array, mean: Array) -> NormalEquations:
        """What was known of the first unknowns: ``mean`` (k,) with inverse covariance ``precision`` (k, k)."""
        k = len(mean)
        matrix, right = self.prior_matrix.copy(), self.prior_right.copy()
        matrix[:k, :k] += precision
        right[:k] += precision @ mean
        return NormalEquations(self.matrix, self.right, matrix, right)


@dataclass(frozen=True)
class Solution:
    """Unknowns (P,) with their covariance (P, P) and the degrees of freedom (P,) of each one's variance."""

    value: Array
    covariance: Array
    degrees_of_freedom: Array
    without: Array
    """(batches, P): the solutions without one batch each."""


def assemble(layout: Layout, sums: Sums, weights: Array, by_instruments: bool = False) -> NormalEquations:
    """``weights`` (n, LAGS) of each joint: see `estimator.whitening`."""
    count, size = len(sums.batches), layout.size
    matrix, right = np.zeros((count, size, size)), np.zeros((count, size))
    for joint in range(layout.body.n):
        unknowns = layout.unknowns(joint)
        p = len(unknowns)
        left = slice(p + 1, 2 * p + 1) if by_instruments else slice(0, p)
        lags = int(np.flatnonzero(weights[joint])[-1]) + 1
        width = sums.batches[0].lagged[joint].shape[1]
        gram = np.empty((count, width, width))
        for batch, own in zip(sums.batches, gram, strict=True):
            np.matmul(weights[joint, :lags], batch.lagged[joint][:lags].reshape(lags, -1), out=own.reshape(-1))
        matrix[:, np.array(unknowns)[:, None], unknowns] += gram[:, left, :p]
        right[:, unknowns] += gram[:, left, p]
    return NormalEquations(matrix, right, np.zeros((size, size)), np.zeros(size))


def solve(equations: NormalEquations) -> Solution:
    """Solution and its covariance by batches, which holds whatever the noise's colour within a batch.

    A prior's own uncertainty is added. With fewer than four batches the covariance is infinite: the data do not say
    how far to trust them.
    """
    total, right = equations.total, equations.total_right
    scale = _scale(total)
    value = np.linalg.solve(total / np.outer(scale, scale), right / scale) / scale
    count, size = equations.right.shape
    if count < 4:
        return Solution(value, np.full((size, size), np.inf), np.zeros(size), np.empty((0, size)))
    # What only one batch can tell leaves a singular rest: the slight ridge turns it into a large error, not a fault.
    rest = (total - equations.matrix) / np.outer(scale, scale) + 1e-12 * np.eye(size)
    without = np.linalg.solve(rest, ((right - equations.right) / scale)[..., None])[..., 0] / scale
    if not np.allclose(total, total.T, rtol=0.0, atol=1e-9 * scale.max() ** 2):
        # Equations with instruments have no leverage: there the solutions without a batch are compared.
        deviation = without - value
        covariance = (count - 1) / count * deviation.T @ deviation
        return Solution(value, covariance, np.full(size, count - 1.0), without)
    covariance, freedom = _by_batches(equations, scale, value)
    return Solution(value, covariance, freedom, without)


def _by_batches(equations: NormalEquations, scale: Array, value: Array) -> tuple[Array, Array]:
    """Covariance (P, P) and its degrees of freedom (P,) from how far each batch pulls at the solution (P,).

    CR2 (Bell and McCaffrey 2002): a batch's pull counts over the square root of what it has left of itself to disagree
    with, (1 − leverage)^½, which is right on average where leaving the batch out, (1 − leverage)¹, is too much. What
    few batches tell has fewer degrees of freedom than there are batches: Satterthwaite's, tr(C)²/tr(C²) with C the
    covariance (batches, batches) that the pulls at one unknown have where the weights are the noise's.
    """
    count = len(equations.right)
    total = equations.total / np.outer(scale, scale)
    inner = np.linalg.inv(np.linalg.cholesky(total))
    own = inner @ (equations.matrix / np.outer(scale, scale)) @ inner.T
    leverage, axes = np.linalg.eigh((own + own.swapaxes(1, 2)) / 2.0)
    left = 1.0 / np.sqrt(np.clip(1.0 - leverage, _LEAST_LEFT, 1.0))
    pull = ((equations.right - equations.matrix @ value) / scale) @ inner.T
    freed = np.einsum("bji,bj->bi", axes, pull) * left
    pull = np.einsum("bij,bj->bi", axes, freed) @ inner / scale
    covariance = pull.T @ pull

    # The same for each unknown's row of the inverse, in the place of the pull: columns of ``inner``.
    rows = axes.swapaxes(1, 2) @ inner
    seen = axes @ ((leverage * left)[:, :, None] * rows)
    alone = np.einsum("bki,bk->bi", rows**2, leverage * left**2)
    shared = np.einsum("bki,cki->ibc", seen, seen, optimize=True)
    products = -shared
    products[:, np.arange(count), np.arange(count)] += alone.T
    variance = np.trace(products, axis1=1, axis2=2)
    square = np.sum(products**2, axis=(1, 2))
    if equations.prior_matrix.any():
        inverse = inner.T @ inner / np.outer(scale, scale)
        known = inverse @ equations.prior_matrix @ inverse
        covariance += known
        variance = variance + np.diag(known) * scale**2
    freedom = np.maximum(variance, 0.0) ** 2 / np.maximum(square, np.finfo(float).tiny)
    return covariance, np.asarray(np.maximum(freedom, 1.0))


def excited(equations: NormalEquations, rank: int, tolerance: float) -> list[int]:
    """Unknowns whose columns the data tell apart, by pivoted elimination on the normalised information.

    An unknown is left out when the ones already taken explain all but ``tolerance`` of its column's energy. The first
    ``rank`` unknowns go first: a rotor inertia that only repeats a link's inertia is left out, not the link.
    """
    total = equations.total
    scale = _scale(total)
    rest = total / np.outer(scale, scale)
    rest[np.diag(total) <= 0.0] = 0.0
    chosen: list[int] = []
    for group in (range(rank), range(rank, len(rest))):
        for _ in group:
            pivot = group[int(np.argmax(np.diag(rest)[group.start : group.stop]))]
            if rest[pivot, pivot] < tolerance:
                break
            chosen.append(pivot)
            rest = rest - np.outer(rest[:, pivot], rest[pivot]) / rest[pivot, pivot]
            rest[chosen] = 0.0
            rest[:, chosen] = 0.0
    return sorted(chosen)


def _scale(total: Array) -> Array:
    diagonal = np.sqrt(np.abs(np.diag(total)))
    return np.asarray(np.where(diagonal > 0.0, diagonal, 1.0))


def residual_autocovariance(layout: Layout, batches: list[Batch], unknowns: Array) -> Array:
    """(n, LAGS): of each joint's residual at these unknowns (P,), mean products over the rows that count."""
    counted = _counted(batches)
    result = np.zeros((layout.body.n, LAGS))
    for joint in range(layout.body.n):
        mine = layout.unknowns(joint)
        direction = np.append(-unknowns[mine], 1.0)
        p = len(mine) + 1
        total = np.sum([batch.lagged[joint][:, :p, :p] for batch in batches], axis=0)
        result[joint] = np.einsum("a,lab,b->l", direction, total, direction) / counted[joint]
    result[:, 1:] /= 2.0
    result[:, 0] = np.maximum(result[:, 0], 0.0)
    return result


def torque_power(layout: Layout, batches: list[Batch]) -> Array:
    """(n,) mean square of the measured torque in the rows that count, N²·m²."""
    counted = _counted(batches)
    power = np.zeros(layout.body.n)
    for joint in range(layout.body.n):
        p = len(layout.unknowns(joint))
        power[joint] = sum(float(batch.lagged[joint][0, p, p]) for batch in batches) / counted[joint]
    return power


def _counted(batches: list[Batch]) -> Array:
    """(n,) rows of each joint by their squared weight; at least one."""
    return np.asarray(np.maximum(np.sum([batch.counted for batch in batches], axis=0), 1.0))
