"""Backlash: a dead band between motor and link."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft, Series

Array = NDArray[np.float64]

SHARPNESS = (0.02, 0.1, 0.3)
"""Torque over which the gap is crossed, to try, as shares of the torque's rms."""


class Backlash(JointEffect):
    """The angle is measured at the motor; the link lies half a gap behind or ahead of it, by the sign of the torque
    that it takes. theta is the sign's width as a share of the torque's rms; the gap's size is the coefficient."""

    name = "backlash"
    units: ClassVar = {"gap": "rad"}
    hidden = (0,)
    confused_with = ("presliding", "joint_elasticity")
    experiment = "reverse joint {joint} where gravity loads it, and where it does not"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array(SHARPNESS)[:, None]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        taken = signals.tau_rigid[:, self.joint(place)]
        width = float(theta[0]) * max(float(np.sqrt(np.mean(taken**2))), np.finfo(float).tiny)
        return -signals.by_angle_error(self.joint(place), 0.5 * np.tanh(taken / width))[:, :, None]

    def limits(self, place: Place, scales: Scales) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gap": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array([SHARPNESS[1]]), np.array([parameters["gap"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.add_series(self.joint(place), Series(gap=float(parameters["gap"])))


EFFECT = Backlash()
