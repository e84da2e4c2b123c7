"""Parameters of a fitted effect with their errors, by propagation of the unknowns' covariance."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.telling.answer import Quantity
from estimator.effects import Parameters
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_STEP = 1e-3
"""Of an unknown's standard error: step of the numerical derivative."""


def quantities(
    hypothesis: Hypothesis, body: RigidBody, theta: Array, coefficients: Array, covariance: Array
) -> dict[str, Quantity]:
    """``covariance`` (p + c, p + c) of [theta | coefficients]."""
    effect, place = hypothesis.effect, hypothesis.place
    unknowns = np.concatenate([theta, coefficients])

    def values(x: Array) -> dict[str, Array]:
        found = effect.parameters(place, x[: len(theta)], x[len(theta) :])
        return {name: np.atleast_1d(np.asarray(value, dtype=float)) for name, value in found.items()}

    at = values(unknowns)
    step = _STEP * np.sqrt(np.maximum(np.diag(covariance), 0.0))
    slopes = {name: np.zeros((len(value), len(unknowns))) for name, value in at.items()}
    for k in np.flatnonzero(step > 0.0):
        moved = [unknowns.copy(), unknowns.copy()]
        moved[0][k] -= step[k]
        moved[1][k] += step[k]
        low, high = (values(x) for x in moved)
        for name, value in at.items():
            # A part of a law that is next to nothing is not there a step below.
            below, above = (side.get(name, value) for side in (low, high))
            ends = np.isfinite(above) & np.isfinite(below)
            steps = step[k] * ((name in low) + (name in high))
            slopes[name][ends, k] = (above[ends] - below[ends]) / max(steps, np.finfo(float).tiny)
    result = {}
    for name, value in at.items():
        error = np.sqrt(np.maximum(np.einsum("ak,kl,al->a", slopes[name], covariance, slopes[name]), 0.0))
        scalar, unit = len(value) == 1, unit_of(hypothesis, name, at, body)
        result[name] = Quantity(float(value[0]) if scalar else value, float(error[0]) if scalar else error, unit)
    return result


def unit_of(hypothesis: Hypothesis, name: str, parameters: Parameters, body: RigidBody) -> str:
    """Of one of an effect's parameters where it lives: a link's stay, a joint's are those of a turning or a sliding
    one."""
    unit, joint = hypothesis.effect.units_of(parameters)[name], hypothesis.place.joint
    return unit if joint is None or hypothesis.effect.name == "link_inertia" else body.axes[joint].unit(unit)
