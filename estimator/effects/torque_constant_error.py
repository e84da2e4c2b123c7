"""Torque constant error: the true torque is g times the measured one."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

LEAST_GAIN, LARGEST_GAIN = 0.3, 3.0
"""Beyond these it is another unit, not another constant."""


class TorqueConstantError(JointEffect):
    """Measured = true/g: the coefficient is 1/g − 1, its column the torque that the given model needs."""

    name = "torque_constant_error"
    in_drive = True
    of_motor = True
    units: ClassVar = {"gain": "–"}
    above_zero = ("gain",)
    confused_with = ("load_dependent_friction", "rotor_inertia", "link_inertia", "payload")
    seen_against = "tau"
    experiment = "rest in several poses with a known payload on {joint}, and without"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.tau_rigid[:, [self.joint(place)], None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.array([1.0 / LARGEST_GAIN - 1.0]), np.array([1.0 / LEAST_GAIN - 1.0])

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gain": 1.0 / (1.0 + float(coefficients[0]))}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([1.0 / float(parameters["gain"]) - 1.0])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.gain[self.joint(place)] *= parameters["gain"]


EFFECT = TorqueConstantError()
