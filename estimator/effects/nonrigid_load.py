"""Nonrigid load: what swings or sloshes in the load answers its motion with a resonance of its own."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.second_order import resonated
from estimator.effects.signals import Scales, Signals

Array = NDArray[np.float64]

TO_BAND = (0.05, 0.15, 0.4)
"""Frequencies to try, as shares of the band in which wrenches are compared."""
RATIOS = (0.05, 0.3)
"""Damping ratios to try."""


class NonrigidLoad(WrenchEffect):
    """Each component of the load's wrench through a resonance within the motion's band, by a factor of its own; theta
    is its frequency and damping ratio. It has no parameters: it says that no rigid body explains the wrench."""

    name = "nonrigid_load"
    units: ClassVar = {}
    confused_with = ("wrench_resonance",)
    experiment = "repeat the motion with the load at another speed"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[scales.band * share, ratio] for share in TO_BAND for ratio in RATIOS])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        wrench = self.wrench(signals)
        swing = resonated(wrench, signals.period, *map(float, theta)) - wrench
        return swing[:, :, None] * np.eye(6)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array([1.0, RATIOS[0]]), np.zeros(6)


EFFECT = NonrigidLoad()
