"""Torque offset: the measured torque reads o too much."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class TorqueOffset(JointEffect):
    name = "torque_offset"
    in_drive = True
    read_off = True
    units: ClassVar = {"offset": "N·m"}
    confused_with = ("asymmetric_friction", "base_tilt", "joint_spring")
    seen_against = "t"
    experiment = "record the torque of {joint} with the drives off, and rest in several poses"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return np.ones((signals.samples, 1, 1))

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"offset": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters["offset"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.offset[self.joint(place)] += parameters["offset"]


EFFECT = TorqueOffset()
