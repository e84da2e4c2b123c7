"""Wrench resonance: the load swings on the compliance of its sensor."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Parameters, Place, WrenchEffect
from estimator.effects.second_order import resonated
from estimator.effects.signals import Scales, Signals

Array = NDArray[np.float64]

TO_BAND = (0.5, 1.0, 2.0, 5.0)
"""Frequencies to try, as multiples of the band in which wrenches are compared."""
RATIOS = (0.02, 0.2)
"""Damping ratios to try."""


class WrenchResonance(WrenchEffect):
    """The load's wrench through a second-order resonance; theta is its frequency and damping ratio. The coefficient is
    a free factor on what the resonance adds, so that far below it the frequency is linear: f over its root."""

    name = "wrench_resonance"
    units: ClassVar = {"frequency": "Hz", "damping": "–"}
    confused_with = ("nonrigid_load", "transport_delay")
    experiment = "tap the load at rest"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[scales.band * share, ratio] for share in TO_BAND for ratio in RATIOS])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        wrench = self.wrench(signals)
        return (resonated(wrench, signals.period, *map(float, theta)) - wrench)[:, :, None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.zeros(1), np.full(1, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        frequency = float(theta[0]) / math.sqrt(coefficients[0]) if coefficients[0] > 0.0 else math.inf
        return {"frequency": frequency, "damping": float(theta[1])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        frequency, damping = float(parameters["frequency"]), float(parameters["damping"])
        if math.isinf(frequency):
            return np.array([1.0, damping]), np.zeros(1)
        return np.array([frequency, damping]), np.ones(1)


EFFECT = WrenchResonance()
