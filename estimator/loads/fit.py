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
from estimator.whitening import weight_of_order, white_weight

Array = NDArray[np.float64]

_EXCITED = 1e-8
"""Share of a column's energy (amplitude 1e-4) that no other column may explain away."""
_TOLD = 1e-3
"""Part of a parameter that may lie in a direction the motion does not show."""
_REWEIGHTINGS = 30
_SETTLED = 1e-3
ROWS_A_COEFFICIENT = 12
"""Rows that must stand behind each autoregressive coefficient; whether there are as many, the noise tells."""


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
        equations = weighted_equations(layout, sums, weights, believed)
        unknowns = _solved(equations, chosen)
        spread = np.zeros((layout.size, layout.size))
        spread[np.ix_(chosen, chosen)] = _inverse_information(equations.of(chosen))
        noise = _noise_autocovariance(layout, sums, unknowns, spread, rows)
        noise[:, 0] = np.maximum(noise[:, 0], 1e-24 * power + np.finfo(float).tiny)
        orders, before = _orders(layout, noise, rows), weights
        weights = np.array([weight_of_order(row, order) for row, order in zip(noise, orders, strict=True)])
        if np.allclose(weights[:, 0], before[:, 0], rtol=_SETTLED, atol=0.0):
            break
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
    shared = [(orders[group[0]], float(rows[group].sum())) for group in layout.alike]
    degrees = min([degrees, *(count / (2.0 * order) for order, count in shared if order)])
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


def _orders(layout: LoadLayout, noise: Array, rows: Array) -> list[int]:
    """Autoregressive order of each channel's noise; where channels are `alike`, ``noise`` gets one colour, in place."""
    result = [0] * len(noise)
    for group in layout.alike:
        noise[group] = noise[group, :1] * np.mean(noise[group] / noise[group, :1], axis=0)
        for k in group:
            result[k] = _order(noise[k], int(rows[group].sum()))
    return result


def _order(autocovariance: Array, rows: int) -> int:
    """By Akaike's criterion: noise that is coloured a little more than it seems costs more than a coefficient."""
    best, order = rows * np.log(autocovariance[0]), 0
    for p in range(1, min(LAGS - 1, rows // ROWS_A_COEFFICIENT) + 1):
        column = autocovariance[:p].copy()
        column[0] *= 1.0 + 1e-6
        explained = solve_toeplitz(column, autocovariance[1 : p + 1]) @ autocovariance[1 : p + 1]
        innovation = max(float(autocovariance[0] - explained), 1e-6 * float(autocovariance[0]))
        score = rows * np.log(innovation) + 2.0 * p
        if score < best:
            best, order = score, p
    return order


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


def _noise_autocovariance(layout: LoadLayout, sums: Sums, unknowns: Array, spread: Array, rows: Array) -> Array:
    """(channels, LAGS) that is expected of the noise: the residual's, and what the unknowns have taken out of it.

    ``spread``: covariance of the unknowns under the present weights. Its share X·spread·Xᵀ is largest where the motion
    is, and slow noise hides there: without it the errors of short recordings would look too small. Iterated, this is
    restricted maximum likelihood by expectation and maximisation (Dempster, Laird and Rubin, 1977).
    """
    result = _residual_autocovariance(layout, sums, unknowns, rows)
    for k in range(len(layout.channels)):
        mine = layout.unknowns(k)
        p = len(mine)
        taken = np.einsum("lab,ab->l", _total(sums.batches, k)[:, :p, :p], spread[np.ix_(mine, mine)]) / rows[k]
        taken[1:] /= 2.0
        result[k] += taken
    return result


def _last(sums: Sums, k: int, lag: int) -> float:
    return float(_total(sums.batches, k)[lag, -1, -1])
