"""How late the wrist sensor is, its own filter included: by profile likelihood, from the fit of the load itself.

Rows are made once with the wrench at a grid of shifts beside one another. The wrench taken back by any delay is then a
linear combination of the last columns (a polynomial through the nearest shifts), so the weighted misfit of the best
load is a quadratic form of its coefficients: the whole profile is algebra on the sums, and so is how far the load would
move with the delay. The profile, with what was believed beforehand, says how likely each delay is; mean and scatter are
the answer, and what that scatter moves adds to the load's error. An empty wrist tells no delay.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar
from scipy.stats import chi2

from estimator.delays import Delay
from estimator.loads.fit import Believed, LoadFit, fit_load, weighted_equations
from estimator.loads.layout import LoadLayout
from estimator.loads.unsure_noise import with_unsure_noise
from estimator.sums import Batch, Sums

Array = NDArray[np.float64]

_STEP = 2.5e-3
SHIFTS: Array = np.linspace(-0.025, 0.025, 21)
"""s; the grid on which the wrench is taken."""
LONGEST = 0.02
"""s; no wrist sensor is later than that."""
UNKNOWN_DELAY = Delay(0.0, 0.01)
"""What is believed of a sensor of which nothing is known."""
_NEIGHBOURS = 8
"""Shifts that a delay between them is interpolated from. What an interpolation smooths of the wrench's noise lessens
the misfit half-way between two shifts, and draws the delay there; of the fastest motion that is kept (25 Hz) eight
neighbours lose 10⁻⁶, four 10⁻³."""
_CHANCE = 1e-3
"""An empty wrist's, to seem to carry something at its likeliest delay."""
_ITERATIONS = 4
_SETTLED = 1e-5
_EVERYWHERE: Array = np.linspace(-LONGEST, LONGEST, 161)
_AROUND: Array = np.linspace(-6.0, 6.0, 49)
"""Times the error: where the likeliest delay's surroundings are looked at more closely."""


@dataclass(frozen=True)
class _Profile:
    """Weighted misfit c·``shape``·c − 2·``slope``·c of the best load, c the coefficients of the shifted wrenches."""

    shape: Array
    slope: Array
    reaction: Array
    """(unknowns, shifts): how the best load moves with the coefficients."""

    def misfit(self, delays: Array, believed: Delay) -> Array:
        """(delays,)"""
        c = np.stack([coefficients(delay) for delay in delays])
        measured = np.einsum("di,ij,dj->d", c, self.shape, c) - 2.0 * c @ self.slope
        return np.asarray(measured + ((delays - believed.value) / believed.standard_error) ** 2)


def fit_with_delay(layout: LoadLayout, sums: Sums, believed: Sequence[Believed], known: Delay) -> tuple[LoadFit, Delay]:
    """The load together with the sensor's delay, from ``sums`` whose rows end with the wrench at each of `SHIFTS`.

    ``known`` is what is believed of the delay; with a standard error of zero it is taken as it is. The load's
    covariance includes what the delay's own error and the noise's unsure spectrum do to it.
    """
    delay = known.value
    fit = fit_load(layout, taken_back(layout, sums, delay), believed)
    if known.standard_error == 0.0:
        return with_unsure_noise(layout, taken_back(layout, sums, delay), believed, fit), known
    for _ in range(_ITERATIONS):
        delays, weights = _posterior(_profile(layout, sums, fit, believed), known, _carries(layout, fit))
        found = float(weights @ delays)
        settled = abs(found - delay) < _SETTLED
        delay = found
        fit = fit_load(layout, taken_back(layout, sums, delay), believed)
        if settled:
            break
    profile = _profile(layout, sums, fit, believed)
    delays, weights = _posterior(profile, known, _carries(layout, fit))
    off = delays - delay
    moved = np.stack([profile.reaction @ (coefficients(each) - coefficients(delay)) for each in delays])
    moved[:, ~fit.told] = 0.0
    fit = with_unsure_noise(layout, taken_back(layout, sums, delay), believed, fit)
    covariance = fit.covariance + (weights[:, None] * moved).T @ moved
    return replace(fit, covariance=covariance), Delay(delay, float(np.sqrt(weights @ off**2)))


def _carries(layout: LoadLayout, fit: LoadFit) -> bool:
    """Whether the wrist carries something: no load at all would hardly give these parameters."""
    load = np.flatnonzero(fit.told[: layout.common])
    covariance = fit.covariance[np.ix_(load, load)]
    errors = np.sqrt(np.diag(covariance))
    scaled = fit.value[load] / errors
    return float(scaled @ np.linalg.pinv(covariance / np.outer(errors, errors)) @ scaled) > chi2.isf(_CHANCE, len(load))


def _posterior(profile: _Profile, known: Delay, told: bool) -> tuple[Array, Array]:
    """Delays (d,) and how likely each is (d,), finely about the likeliest and coarsely everywhere; by what is believed
    of them alone unless the wrench has ``told`` something."""
    if not told:
        believed = np.clip(known.value + known.standard_error * _AROUND, -LONGEST, LONGEST)
        weights = np.exp(-0.5 * _AROUND**2)
        return believed, weights / weights.sum()
    coarse = profile.misfit(_EVERYWHERE, known)
    step = float(_EVERYWHERE[1] - _EVERYWHERE[0])
    best = float(_EVERYWHERE[np.argmin(coarse)])
    bounds = (max(best - step, -LONGEST), min(best + step, LONGEST))
    found = minimize_scalar(
        lambda delay: float(profile.misfit(np.array([delay]), known)[0]),
        bounds=bounds,
        method="bounded",
        options={"xatol": 1e-7},
    )
    likeliest = float(found.x)
    near = profile.misfit(likeliest + 0.2 * _STEP * np.array([-1.0, 0.0, 1.0]), known)
    curvature = (near[0] - 2.0 * near[1] + near[2]) / (0.2 * _STEP) ** 2
    # The prior's own curvature is the least there can be; a sum of squares has twice the inverse variance.
    error = np.sqrt(2.0 / max(curvature, 2.0 / known.standard_error**2))
    around = likeliest + error * _AROUND
    delays = np.union1d(_EVERYWHERE, around[np.abs(around) <= LONGEST])
    misfit = profile.misfit(delays, known)
    weights = np.exp(0.5 * (misfit.min() - misfit)) * np.gradient(delays)
    return delays, weights / weights.sum()


def coefficients(delay: float) -> Array:
    """(shifts,) of the wrench at t + ``delay`` from its values at t + `SHIFTS`: Lagrange's polynomial."""
    place = (np.clip(delay, -LONGEST, LONGEST) - SHIFTS[0]) / _STEP
    first = int(np.clip(np.floor(place) - _NEIGHBOURS // 2 + 1, 0, len(SHIFTS) - _NEIGHBOURS))
    u = place - first
    result = np.zeros(len(SHIFTS))
    for k in range(_NEIGHBOURS):
        others = [j for j in range(_NEIGHBOURS) if j != k]
        result[first + k] = np.prod([(u - j) / (k - j) for j in others])
    return result


def taken_back(layout: LoadLayout, sums: Sums, delay: float) -> Sums:
    """The sums with one wrench in place of the shifted ones: that of ``delay``."""
    c = coefficients(delay)
    turns = []
    for k in range(len(layout.channels)):
        p = len(layout.unknowns(k))
        turn = np.zeros((p + len(SHIFTS), p + 1))
        turn[:p, :p], turn[p:, p] = np.eye(p), c
        turns.append(turn)
    batches = [
        Batch(b.rows, b.recording, [t.T @ lagged @ t for t, lagged in zip(turns, b.lagged, strict=True)], b.counted)
        for b in sums.batches
    ]
    return Sums(batches, sums.samples, sums.duration)


def _profile(layout: LoadLayout, sums: Sums, fit: LoadFit, believed: Sequence[Believed]) -> _Profile:
    size, count = layout.size, len(SHIFTS)
    right, power = np.zeros((size, count)), np.zeros((count, count))
    for k in range(len(layout.channels)):
        mine = layout.unknowns(k)
        total = np.tensordot(fit.weights[k], np.sum([b.lagged[k] for b in sums.batches], axis=0), axes=1)
        p = len(mine)
        right[mine] += total[:p, p:]
        power += total[p:, p:]
    equations = weighted_equations(layout, taken_back(layout, sums, 0.0), fit.weights, believed).of(fit.chosen)
    scale = np.sqrt(np.diag(equations.total))
    inverse = np.linalg.inv(equations.total / np.outer(scale, scale)) / np.outer(scale, scale)
    right = right[fit.chosen]
    reaction = np.zeros((size, count))
    reaction[fit.chosen] = inverse @ right
    return _Profile(power - right.T @ inverse @ right, right.T @ inverse @ equations.prior_right, reaction)
