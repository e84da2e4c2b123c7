"""How late the wrist sensor is, its own filter included: by profile likelihood, from the fit of the load itself.

Rows are made once with the wrench at a grid of shifts beside one another. The wrench taken back by any delay is then a
linear combination of the last columns (cubic interpolation between the shifts), so the weighted misfit of the best
load is a quadratic form of its coefficients: the whole profile is algebra on the sums, and so are its curvature, which
gives the error, and how far the load would move with the delay, which adds to the load's own.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

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
_ITERATIONS = 4
_SETTLED = 1e-5


@dataclass(frozen=True)
class _Profile:
    """Weighted misfit c·``shape``·c − 2·``slope``·c of the best load, c the coefficients of the shifted wrenches."""

    shape: Array
    slope: Array
    reaction: Array
    """(unknowns, shifts): how the best load moves with the coefficients."""

    def misfit(self, delay: float, believed: Delay) -> float:
        c = coefficients(delay)
        return (
            float(c @ self.shape @ c - 2.0 * self.slope @ c) + ((delay - believed.value) / believed.standard_error) ** 2
        )


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
        profile = _profile(layout, sums, fit, believed)
        found = minimize_scalar(
            profile.misfit, bounds=(-LONGEST, LONGEST), args=(known,), method="bounded", options={"xatol": 1e-7}
        )
        settled = abs(float(found.x) - delay) < _SETTLED
        delay = float(found.x)
        fit = fit_load(layout, taken_back(layout, sums, delay), believed)
        if settled:
            break
    profile = _profile(layout, sums, fit, believed)
    step = 0.2 * _STEP
    near = [profile.misfit(delay + k * step, known) for k in (-1, 0, 1)]
    curvature = (near[0] - 2.0 * near[1] + near[2]) / step**2
    # The prior's own curvature is the least there can be; a sum of squares has twice the inverse variance.
    error = float(np.sqrt(2.0 / max(curvature, 2.0 / known.standard_error**2)))
    moved = profile.reaction @ (coefficients(delay + step) - coefficients(delay - step)) / (2.0 * step)
    moved[~fit.told] = 0.0
    fit = with_unsure_noise(layout, taken_back(layout, sums, delay), believed, fit)
    return replace(fit, covariance=fit.covariance + error**2 * np.outer(moved, moved)), Delay(delay, error)


def coefficients(delay: float) -> Array:
    """(shifts,) of the wrench at t + ``delay`` from its values at t + `SHIFTS`: the cubic through the nearest four."""
    place = (np.clip(delay, -LONGEST, LONGEST) - SHIFTS[0]) / _STEP
    first = int(np.clip(np.floor(place) - 1, 0, len(SHIFTS) - 4))
    u = place - first
    result = np.zeros(len(SHIFTS))
    for k in range(4):
        others = [j for j in range(4) if j != k]
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
