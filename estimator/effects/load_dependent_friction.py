"""Load-dependent friction: μ·|transmitted torque|·sign(dq), of gears and seals that are pressed together."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class LoadDependentFriction(JointEffect):
    """What is transmitted is taken from the given model; theta is the sign's width."""

    name = "load_dependent_friction"
    dry = True
    in_drive = True
    units: ClassVar = {"coefficient": "–"}
    hidden = (0,)
    confused_with = ("torque_constant_error", "coulomb_friction")
    seen_against = "dq"
    experiment = "play the same path under two payloads"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.asarray(np.array(WIDTHS) * scales.dq[self.joint(place)])[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        pressed = np.abs(signals.tau_rigid[:, joint]) * signals.direction(joint, float(theta[0]))
        return np.asarray(pressed[:, None, None])

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"coefficient": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array([SHARP]), np.array([parameters["coefficient"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        coefficient = float(parameters["coefficient"])
        plant.rubbing.append((self.joint(place), lambda at: coefficient * abs(at.transmitted)))


EFFECT = LoadDependentFriction()
