"""What a short recording leaves open of its noise's spectrum, and what that adds to the errors of the load.

With a few dozen rows the spectrum that weighs them is itself an estimate, and the motion hides the slow part of it: an
error that takes one spectrum for the true one is too small (Kenward and Roger, 1997), the more so where one order of
the autoregressive model was chosen for it. Here spectra of the highest order that the rows carry, which holds all lower
ones, are drawn by how likely they leave the rows (restricted likelihood, Patterson and Thompson, 1971; importance
sampling about the mode). The load is estimated under each, and its covariance is that of the mixture: the mean of the
covariances, and the scatter of the estimates. Student's degrees of freedom are those whose fourth moment is the
mixture's. All of it is algebra on the lagged sums.

Beforehand, each power counts as equally likely on a logarithmic scale, each partial autocorrelation between −1 and 1.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, multivariate_t, norm, qmc

from estimator.loads.fit import ROWS_A_COEFFICIENT, Believed, LoadFit, weighted_equations
from estimator.loads.layout import LoadLayout
from estimator.sums import LAGS, Sums

Array = NDArray[np.float64]

_DRAWS = 256
"""Spectra; a power of two (Sobol)."""
_TAIL = 6
"""Degrees of freedom of the proposal: wider than the likelihood, so that no draw counts for very much."""
_NEWTON = 12
_STEP = 1e-2
"""For differences: of a logarithm of a power, and of an inverse hyperbolic tangent."""
_LEAST_CURVATURE = 0.5
_FLAT = 0.999
"""Largest partial autocorrelation."""


def with_unsure_noise(layout: LoadLayout, sums: Sums, believed: Sequence[Believed], fit: LoadFit) -> LoadFit:
    """The ``fit`` of these sums, its spectrum being as unsure as the rows leave it."""
    likelihood = _Likelihood(layout, sums, believed, fit)
    least = min(int(sums.counted[group].sum()) for group in layout.alike)
    mode, spread = _mode(likelihood, min(LAGS - 1, least // ROWS_A_COEFFICIENT))
    parameters = _draws(mode, spread)
    value, covariances, score = likelihood(parameters)
    weight = score - multivariate_t(mode, spread, _TAIL).logpdf(parameters)
    weight = np.exp(weight - weight.max())
    weight /= weight.sum()

    mean = weight @ value
    off = value - mean
    covariance = np.tensordot(weight, covariances, axes=1) + (weight[:, None] * off).T @ off
    variance = np.diagonal(covariances, axis1=1, axis2=2)
    fourth = weight @ (3.0 * variance**2 + 6.0 * variance * off**2 + off**4)
    # Student's kurtosis is 3 + 6/(ν − 4).
    beyond = fourth / np.diag(covariance) ** 2 - 3.0
    common = np.array([k < layout.common for k in fit.chosen])
    freedom = 4.0 + 6.0 / max(float(np.median(beyond[common])), 6.0 / fit.degrees_of_freedom)

    filled, full = fit.filled.copy(), fit.covariance.copy()
    filled[fit.chosen] += mean
    told = np.flatnonzero(fit.told[fit.chosen])
    place = np.array(fit.chosen)[told]
    full[np.ix_(place, place)] = covariance[np.ix_(told, told)]
    value_told = np.where(fit.told, filled, np.nan)
    return replace(fit, value=value_told, covariance=full, filled=filled, degrees_of_freedom=freedom)


class _Likelihood:
    """Restricted likelihood of spectra; parameters (d,) are each channel's log innovation variance and, group by group
    of channels that are alike, the inverse hyperbolic tangents of the partial autocorrelations."""

    def __init__(self, layout: LoadLayout, sums: Sums, believed: Sequence[Believed], fit: LoadFit) -> None:
        self.groups = layout.alike
        self.rows = np.maximum(sums.counted, 1.0)
        place = {unknown: k for k, unknown in enumerate(fit.chosen)}
        self._lagged: list[Array] = []
        self._places: list[NDArray[np.intp]] = []
        self.power = np.zeros(len(layout.channels))
        for k in range(len(layout.channels)):
            mine = layout.unknowns(k)
            total = np.sum([batch.lagged[k] for batch in sums.batches], axis=0)
            # About the fit: what is left instead of the wrench, so that no large numbers cancel.
            kept = [column for column, unknown in enumerate(mine) if unknown in place]
            turn = np.zeros((len(mine) + 1, len(kept) + 1))
            turn[kept, np.arange(len(kept))] = 1.0
            turn[:, -1] = np.append(-fit.filled[mine], 1.0)
            lagged = turn.T @ total @ turn
            # What rounding leaves of sums this large is no noise.
            lagged[0, -1, -1] = max(lagged[0, -1, -1], 0.0) + np.finfo(float).eps * total[0, -1, -1]
            self._lagged.append(lagged)
            self._places.append(np.array([place[mine[column]] for column in kept], dtype=np.intp))
            self.power[k] = max(lagged[0, -1, -1] / self.rows[k], np.finfo(float).tiny)
        alone = weighted_equations(layout, Sums(), fit.weights, believed).of(fit.chosen)
        self._prior = alone.prior_matrix
        self._prior_right = alone.prior_right - alone.prior_matrix @ fit.filled[fit.chosen]

    def __call__(self, parameters: Array) -> tuple[Array, Array, Array]:
        """Of draws (draws, d): estimates less the fit's (draws, P), covariances (draws, P, P), log likelihoods."""
        count = len(parameters)
        weights, log_likelihood = self._weights(parameters)
        matrix = np.tile(self._prior, (count, 1, 1))
        right = np.tile(self._prior_right, (count, 1))
        left = np.zeros(count)
        for weight, lagged, place in zip(weights.swapaxes(0, 1), self._lagged, self._places, strict=True):
            gram = np.tensordot(weight, lagged, axes=1)
            matrix[:, place[:, None], place] += gram[:, :-1, :-1]
            right[:, place] += gram[:, :-1, -1]
            left += gram[:, -1, -1]
        scale = np.sqrt(np.diagonal(matrix, axis1=1, axis2=2))
        both = scale[:, :, None] * scale[:, None, :]
        covariance = np.linalg.inv(matrix / both) / both
        value = (covariance @ right[..., None])[..., 0]
        log_information = np.linalg.slogdet(matrix / both)[1] + 2.0 * np.log(scale).sum(axis=1)
        misfit = left - np.einsum("dp,dp->d", value, right)
        return value, covariance, log_likelihood - (log_information + misfit) / 2.0

    def start(self, order: int) -> Array:
        """(d,) white noise of the residual's power."""
        return np.concatenate([np.log(self.power), np.zeros(order * len(self.groups))])

    def _weights(self, parameters: Array) -> tuple[Array, Array]:
        """(draws, channels, LAGS) on the lagged sums; (draws,) what the likelihood has of the spectrum alone."""
        channels = len(self.power)
        order = (parameters.shape[1] - channels) // len(self.groups)
        weights = np.zeros((len(parameters), channels, LAGS))
        score = -0.5 * parameters[:, :channels] @ self.rows
        for number, group in enumerate(self.groups):
            first = channels + number * order
            partial = np.clip(np.tanh(parameters[:, first : first + order]), -_FLAT, _FLAT)
            a = _whitening_filters(partial)
            lagged = np.stack(
                [np.sum(a[:, : a.shape[1] - lag] * a[:, lag:], axis=1) for lag in np.arange(order + 1)], 1
            )
            for k in group:
                weights[:, k, : order + 1] = lagged * np.exp(-parameters[:, k, None])
            # Even between −1 and 1, seen on the scale of the inverse hyperbolic tangent.
            score += np.log(1.0 - partial**2).sum(axis=1)
        return weights, score


def _whitening_filters(partial: Array) -> Array:
    """(draws, order + 1), the first 1, of partial autocorrelations (draws, order): Levinson's recursion."""
    a = np.ones((len(partial), 1))
    for k in partial.T:
        longer = np.pad(a, ((0, 0), (0, 1)))
        a = longer - k[:, None] * longer[:, ::-1]
    return a


def _draws(mode: Array, spread: Array) -> Array:
    """(draws, d) of Student's distribution about the mode, evenly spread; the same in every run."""
    even = np.clip(qmc.Sobol(len(mode) + 1, seed=0).random(_DRAWS), 1e-9, 1.0 - 1e-9)
    wide = np.sqrt(_TAIL / chi2.ppf(even[:, -1], _TAIL))
    return np.asarray(mode + (norm.ppf(even[:, :-1]) * wide[:, None]) @ np.linalg.cholesky(spread).T)


def _mode(likelihood: _Likelihood, order: int) -> tuple[Array, Array]:
    """The likeliest parameters (d,), by damped Newton steps, and the inverse curvature there (d, d)."""
    parameters = likelihood.start(order)
    d = len(parameters)
    pairs = np.triu_indices(d, 1)
    one = _STEP * np.eye(d)
    steps = np.concatenate([np.zeros((1, d)), one, -one, one[pairs[0]] + one[pairs[1]]])
    for _ in range(_NEWTON):
        score = likelihood(parameters + steps)[2]
        here, up, down, both = score[0], score[1 : d + 1], score[d + 1 : 2 * d + 1], score[2 * d + 1 :]
        curvature = np.diag(up + down - 2.0 * here)
        curvature[pairs] = both - up[pairs[0]] - up[pairs[1]] + here
        curvature = curvature + np.triu(curvature, 1).T
        eigenvalues, vectors = np.linalg.eigh(-curvature / _STEP**2)
        eigenvalues = np.maximum(np.abs(eigenvalues), _LEAST_CURVATURE)
        spread = (vectors / eigenvalues) @ vectors.T
        move = spread @ (up - down) / (2.0 * _STEP)
        move *= min(1.0, 1.0 / float(np.abs(move).max(initial=_STEP)))
        tried = move * 0.5 ** np.arange(8)[:, None]
        gained = likelihood(parameters + tried)[2] - here
        best = int(np.argmax(gained))
        if gained[best] <= 1e-4:
            break
        parameters = parameters + tried[best]
    return parameters, np.asarray(spread)
