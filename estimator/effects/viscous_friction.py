"""Viscous friction: b·dq."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class ViscousFriction(JointEffect):
    name = "viscous_friction"
    momentary = True
    in_drive = True
    units: ClassVar = {"coefficient": "N·m·s/rad"}
    confused_with = ("coulomb_friction", "stribeck_friction")
    seen_against = "dq"
    experiment = "move {joint} at six or more constant speeds, both ways"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.dq[:, [self.joint(place)], None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"coefficient": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters["coefficient"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.viscous[self.joint(place)] += parameters["coefficient"]


EFFECT = ViscousFriction()
