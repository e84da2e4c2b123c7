"""Least squares on the sums of load rows: each channel weighted by its own noise's inverse spectrum."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from estimator.loads.layout import LoadLayout
from estimator.normal_equations import NormalEquations, excited
from estimator.sums import LAGS, Batch, Sums
from estimator.whitening import white_weight, whitening_weight

Array = NDArray[np.float64]

_EXCITED = 1e-8
"""Share of a column's energy (amplitude 1e-4) that no other column may explain away."""
_TOLD = 1e-3
"""Part of a parameter that may lie in a direction the motion does not show."""
_REWEIGHTINGS = 4
_ROWS_A_COEFFICIENT = 40
"""As in `estimator.whitening`."""


@dataclass(frozen=True)
class Believed:
    """Known beforehand of some unknowns: ``mean`` (k,) of ``rows``·unknowns (k, size), ``covariance`` (k, k)."""

    rows: Array
    mean: Array
    covariance: Array


@dataclass(frozen=True)
class LoadFit:
    """Unknowns (size,) with their covariance; NaN and infinite variance where the data do not tell one."""

    value: Array
    covariance: Array
    degrees_of_freedom: float
    told: NDArray[np.bool_]
    filled: Array
    """(size,) one of the equally good answers where some are not told: for predicting wrenches of the same motion."""
    autocovariance: Array
    """(channels, LAGS) of the residual rows, N² or N²·m²."""
    power: Array
    """(channels,) mean square of the measured rows."""
    weights: Array
    """(channels, LAGS) on the lagged sums: the inverse spectrum of each channel's noise."""
    chosen: list[int]
    """Unknowns that were solved for; the others are zero in `filled`."""


def fit_load(layout: LoadLayout, sums: Sums, believed: Sequence[Believed] = ()) -> LoadFit:
    """Iteratively reweighted, whitened least squares; at least 8 rows.

    The covariance is the inverse of the information with the residual's own autoregressive spectrum, so it holds for
    coloured, stationary noise.
    """
    rows = np.maximum(sums.counted, 1.0)
    power = np.array([_last(sums, k, 0) / rows[k] for k in range(len(layout.channels))])
    weights = np.array([white_weight(max(p, np.finfo(float).tiny)) for p in power])
    plain = weighted_equations(layout, sums, weights, believed)
    chosen = excited(plain, layout.size, _EXCITED)
    for _ in range(_REWEIGHTINGS):
        unknowns = _solved(weighted_equations(layout, sums, weights, believed), chosen)
        autocovariance = _residual_autocovariance(layout, sums, unknowns, rows)
        fitted = len(chosen) / len(layout.channels)
        inflated = autocovariance * (rows / np.maximum(1.0, rows - fitted))[:, None]
        inflated[:, 0] = np.maximum(inflated[:, 0], 1e-24 * power + np.finfo(float).tiny)
        orders = [_order(row, int(count)) for row, count in zip(inflated, rows, strict=True)]
        weights = np.array([_weight(row, order) for row, order in zip(inflated, orders, strict=True)])
    equations = weighted_equations(layout, sums, weights, believed)
    unknowns = _solved(equations, chosen)
    told = _told(plain)
    covariance = np.full((layout.size, layout.size), np.nan)
    covariance[np.ix_(chosen, chosen)] = _inverse_information(equations.of(chosen))
    covariance[~told], covariance[:, ~told] = np.nan, np.nan
    covariance[~told, ~told] = np.inf
    value = np.where(told, unknowns, np.nan)
    autocovariance = _residual_autocovariance(layout, sums, unknowns, rows)
    degrees = max(1.0, float(rows.max()) - len(chosen) / len(layout.channels))
    # A spectrum from an autoregressive model of order p over N rows is as sure as a variance from N/2p values.
    degrees = min(
        [degrees, *(float(count) / (2.0 * order) for order, count in zip(orders, rows, strict=True) if order)]
    )
    return LoadFit(value, covariance, degrees, told, unknowns, autocovariance, power, weights, chosen)


def weighted_equations(layout: LoadLayout, sums: Sums, weights: Array, believed: Sequence[Believed]) -> NormalEquations:
    """Normal equations with each channel's lagged sums under its ``weights`` (channels, LAGS), and what is believed."""
    size, count = layout.size, len(sums.batches)
    matrix, right = np.zeros((count, size, size)), np.zeros((count, size))
    for k in range(len(layout.channels)):
        mine = layout.unknowns(k)
        place, p = np.ix_(mine, mine), len(mine)
        for b, batch in enumerate(sums.batches):
            gram = np.tensordot(weights[k], batch.lagged[k], axes=1)
            matrix[b][place] += gram[:p, :p]
            right[b, mine] += gram[:p, p]
    prior, prior_right = np.zeros((size, size)), np.zeros(size)
    for known in believed:
        carried = np.linalg.solve(known.covariance, known.rows)
        prior += known.rows.T @ carried
        prior_right += carried.T @ known.mean
    return NormalEquations(matrix, right, prior, prior_right)


def _solved(equations: NormalEquations, chosen: list[int]) -> Array:
    part = equations.of(chosen)
    scale = np.sqrt(np.diag(part.total))
    result = np.zeros(equations.right.shape[1])
    result[chosen] = np.linalg.solve(part.total / np.outer(scale, scale), part.total_right / scale) / scale
    return result


def _order(autocovariance: Array, rows: int) -> int:
    """Autoregressive order by the Bayesian information criterion: a model too rich makes errors look too small."""
    best, order = rows * np.log(autocovariance[0]), 0
    for p in range(1, min(LAGS - 1, rows // _ROWS_A_COEFFICIENT) + 1):
        column = autocovariance[:p].copy()
        column[0] *= 1.0 + 1e-6
        explained = solve_toeplitz(column, autocovariance[1 : p + 1]) @ autocovariance[1 : p + 1]
        innovation = max(float(autocovariance[0] - explained), 1e-6 * float(autocovariance[0]))
        score = rows * np.log(innovation) + p * np.log(rows)
        if score < best:
            best, order = score, p
    return order


def _weight(autocovariance: Array, order: int) -> Array:
    """`whitening_weight` of this very order."""
    if order == 0:
        return white_weight(float(autocovariance[0]))
    return whitening_weight(autocovariance, order * _ROWS_A_COEFFICIENT)


def _inverse_information(equations: NormalEquations) -> Array:
    scale = np.sqrt(np.diag(equations.total))
    return np.asarray(np.linalg.inv(equations.total / np.outer(scale, scale)) / np.outer(scale, scale))


def _told(equations: NormalEquations) -> NDArray[np.bool_]:
    """Unknowns that no direction without information has a part in."""
    total = equations.total
    scale = np.sqrt(np.diag(total))
    seen = scale > 0.0
    eigenvalues, vectors = np.linalg.eigh(total[np.ix_(seen, seen)] / np.outer(scale[seen], scale[seen]))
    hidden = vectors[:, eigenvalues < _EXCITED]
    told = np.zeros(len(scale), dtype=np.bool_)
    told[np.flatnonzero(seen)[(hidden**2).sum(axis=1) < _TOLD**2]] = True
    return told


def _residual_autocovariance(layout: LoadLayout, sums: Sums, unknowns: Array, rows: Array) -> Array:
    result = np.zeros((len(layout.channels), LAGS))
    for k in range(len(layout.channels)):
        direction = np.append(-unknowns[layout.unknowns(k)], 1.0)
        total = _total(sums.batches, k)
        result[k] = np.einsum("a,lab,b->l", direction, total, direction) / rows[k]
    result[:, 1:] /= 2.0
    result[:, 0] = np.maximum(result[:, 0], 0.0)
    return result


def _total(batches: list[Batch], k: int) -> Array:
    return np.asarray(np.sum([batch.lagged[k] for batch in batches], axis=0))


def _last(sums: Sums, k: int, lag: int) -> float:
    return float(_total(sums.batches, k)[lag, -1, -1])
