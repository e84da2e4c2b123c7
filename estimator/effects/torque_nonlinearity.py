"""Torque nonlinearity: the motor gives less than is measured, near zero or near its limit."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

_MOST = 0.98
"""Of a limit, what torques come to."""


class TorqueNonlinearity(JointEffect):
    """Near zero: true = measured less ``dead_zone``, so measured = true + dead_zone·sign(true).

    Towards saturation: true = limit·tanh(measured/limit), so measured = true + true³/(3·limit²) + …; the
    coefficient is 1/(3·limit²). A parameter whose coefficient is zero is not there. theta is the width of the sign
    of the torque, as a share of the torque's rms, then that coefficient, by which the series has an end.
    """

    name = "torque_nonlinearity"
    in_drive = True
    of_motor = True
    units: ClassVar = {"limit": "N·m", "dead_zone": "N·m"}
    hidden = (0,)
    about = (1,)
    confused_with = ("torque_constant_error", "coulomb_friction")
    seen_against = "tau"
    experiment = "let the torque of {joint} rise slowly towards its limit, and pass slowly through zero"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[0.01, 0.0], [0.1, 0.0], [0.3, 0.0], [1.0, 0.0]])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        true = signals.tau_motor[:, self.joint(place)]
        size = max(float(np.sqrt(np.mean(true**2))), np.finfo(float).tiny)
        return np.stack([_saturating(true, float(theta[1])), np.tanh(true / (theta[0] * size))], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        cubic, dead = map(float, coefficients)
        found = {"limit": 1.0 / math.sqrt(3.0 * cubic)} if cubic > 0.0 else {}
        return found | ({"dead_zone": dead} if dead > 0.0 else {})

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        cubic = 1.0 / (3.0 * float(parameters["limit"]) ** 2) if "limit" in parameters else 0.0
        return np.array([0.01, cubic]), np.array([cubic, float(parameters.get("dead_zone", 0.0))])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        if "dead_zone" in parameters:
            dead = float(parameters["dead_zone"])
            plant.motor.append((self.joint(place), lambda tau: math.copysign(max(abs(tau) - dead, 0.0), tau)))
        if "limit" in parameters:
            limit = float(parameters["limit"])
            plant.motor.append((self.joint(place), lambda tau: limit * math.tanh(tau / limit)))


def _saturating(true: Array, cubic: float) -> Array:
    """(samples,) what more than the ``true`` torque is measured, for each unit of the coefficient that is ``cubic``."""
    if cubic <= 0.0:
        return np.asarray(true**3)
    share = np.clip(true * math.sqrt(3.0 * cubic), -_MOST, _MOST)
    lost = (np.arctanh(share) - share) / np.where(share == 0.0, 1.0, share**3)
    return np.asarray(3.0 * np.where(share == 0.0, 1.0 / 3.0, lost) * true**3)


EFFECT = TorqueNonlinearity()
