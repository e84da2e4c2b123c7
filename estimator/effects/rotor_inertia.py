"""Rotor inertia: J·ddq of the motor behind its gear, felt by its own joint alone."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class RotorInertia(JointEffect):
    name = "rotor_inertia"
    momentary = True
    in_drive = True
    units: ClassVar = {"inertia": "kg·m²"}
    confused_with = ("link_inertia", "torque_constant_error", "joint_elasticity")
    seen_against = "ddq"
    experiment = "move {joint} alone, in two poses of the joints after it"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.ddq[:, [self.joint(place)], None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"inertia": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters["inertia"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.armature[self.joint(place)] += parameters["inertia"]


EFFECT = RotorInertia()
