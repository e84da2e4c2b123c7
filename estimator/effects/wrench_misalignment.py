"""Wrench misalignment: the sensor is mounted turned by a rotation vector (3,)."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.signals import Signals

Array = NDArray[np.float64]


class WrenchMisalignment(WrenchEffect):
    """measured = R(rotation)ᵀ · true, for small rotations."""

    name = "wrench_misalignment"
    units: ClassVar = {"rotation": "rad"}
    confused_with = ("wrench_gain", "payload")
    experiment = "rest in a grid of poses"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        wrench = self.wrench(signals)
        force, torque = wrench[:, :3], wrench[:, 3:]
        turned = [np.hstack([np.cross(force, axis), np.cross(torque, axis)]) for axis in np.eye(3)]
        return np.stack(turned, axis=2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"rotation": np.array(coefficients)}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array(parameters["rotation"], dtype=float)


EFFECT = WrenchMisalignment()
