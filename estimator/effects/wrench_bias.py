"""Wrench bias: the sensor reads a constant (6,) too much."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.signals import Signals

Array = NDArray[np.float64]


class WrenchBias(WrenchEffect):
    """Force, then torque."""

    name = "wrench_bias"
    units: ClassVar = {"bias": "N, N·m"}
    confused_with = ("wrench_drift", "wrench_gain")
    experiment = "rest in a grid of poses, tared before and after"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return np.tile(np.eye(6), (signals.samples, 1, 1))

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"bias": np.array(coefficients)}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array(parameters["bias"], dtype=float)


EFFECT = WrenchBias()
