"""Wrench gain: the calibration matrix (6, 6) differs from the identity."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.signals import Signals

Array = NDArray[np.float64]


class WrenchGain(WrenchEffect):
    """measured = matrix · true, row after row."""

    name = "wrench_gain"
    units: ClassVar = {"matrix": "–"}
    confused_with = ("wrench_misalignment", "payload")
    experiment = "take up a known mass and rest in many poses"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        wrench = self.wrench(signals)
        return np.asarray(np.einsum("ij,sk->sijk", np.eye(6), wrench)).reshape(len(wrench), 6, 36)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"matrix": np.eye(6).ravel() + coefficients}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.ravel(parameters["matrix"]) - np.eye(6).ravel()


EFFECT = WrenchGain()
