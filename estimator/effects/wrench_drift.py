"""Wrench drift: the sensor's bias grows by a constant (6,) a second."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.signals import Signals

Array = NDArray[np.float64]


class WrenchDrift(WrenchEffect):
    """Nothing at the recording's start."""

    name = "wrench_drift"
    units: ClassVar = {"rate": "N/s, N·m/s"}
    confused_with = ("wrench_bias", "friction_drift")
    experiment = "rest in a grid of poses, tared before and after"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.t[:, None, None] * np.eye(6)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"rate": np.array(coefficients)}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array(parameters["rate"], dtype=float)


EFFECT = WrenchDrift()
