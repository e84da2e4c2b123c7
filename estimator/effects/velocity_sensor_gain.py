"""Velocity sensor gain: the measured velocity is g times the true one."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class VelocitySensorGain(JointEffect):
    """Enters the velocity equation alone: the torque equation takes its velocities from the angles."""

    name = "velocity_sensor_gain"
    units: ClassVar = {"gain": "–"}
    above_zero = ("gain",)
    confused_with = ("viscous_friction", "encoder_eccentricity")
    seen_against = "dq"
    experiment = "compare the velocity of {joint} with the slope of its angle"
    equation = "velocity"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.dq[:, [self.joint(place)], None]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gain": 1.0 + float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([float(parameters["gain"]) - 1.0])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.velocity_gain[self.joint(place)] *= parameters["gain"]


EFFECT = VelocitySensorGain()
