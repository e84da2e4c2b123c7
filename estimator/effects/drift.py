"""What goes from one value to another while a joint runs in, or with its temperature."""

from __future__ import annotations

from abc import abstractmethod

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place, SeenAgainst
from estimator.effects.signals import Scales, Signals

Array = NDArray[np.float64]

SHORTEST = 0.2
"""Of the time constants to try, as a share of the longest recording …"""
SHORTEST_S = 4.0
"""… but no less: nothing that a joint's work warms or wears in changes sooner, and in the time of a single stroke any
law of friction looks like a change."""
COURSE = {"time_constant": "s", "initial_temperature": "°C", "final_temperature": "°C"}
"""Units of the parameters of either course."""
UNKNOWN = 0.5
"""Of the way from the coldest to the warmest, where a joint of unknown temperature is."""


class Drift(JointEffect):
    """(final + (initial − final)·exp(−t/T))·carrier, t from the recording's start; or, where the joint's temperature
    was recorded and changes, straight between the values at the coldest and at the warmest. theta begins with T, which
    is zero of the second course, and the two temperatures, which are zero of the first; what shapes the carrier
    follows.

    Of a motion that is only planned, and in the twin, the joint is half as warm as it gets."""

    drifts = True
    choices = (1, 2)
    named_for = (0, 1)
    levels = (0, 1)
    above_zero = ("time_constant",)
    seen_against = "t"

    @classmethod
    def ends(cls) -> list[str]:
        """The parameters' names of both values."""
        return [name for name in cls.units if name not in COURSE]

    @abstractmethod
    def carrier(self, place: Place, signals: Signals, shape: Array) -> Array:
        """(samples,) what is multiplied."""

    def courses(self, place: Place, scales: Scales) -> list[list[float]]:
        """The first three entries of each theta to try."""
        first, joint = max(SHORTEST * scales.duration, SHORTEST_S), self.joint(place)
        result = [[float(time), 0.0, 0.0] for time in np.geomspace(first, max(scales.duration, 2.0 * first), 3)]
        if scales.warms(joint):
            result.append([0.0, float(scales.cold[joint]), float(scales.warm[joint])])
        return result

    def seen_at(self, theta: Array) -> SeenAgainst:
        return "temperature" if by_temperature(theta) else "t"

    def told_by_repeats(self, theta: Array) -> bool:
        return not by_temperature(theta)

    def redundant(self, theta: Array) -> int:
        return 2 if by_temperature(theta) else 0

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        carrier, left = self.carrier(place, signals, theta[3:]), course(signals, self.joint(place), theta)
        return np.stack([carrier * left, carrier * (1.0 - left)], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        values = dict(zip(self.ends(), map(float, coefficients), strict=True))
        if by_temperature(theta):
            return values | {"initial_temperature": float(theta[1]), "final_temperature": float(theta[2])}
        return values | {"time_constant": float(theta[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        values = np.array([float(parameters[name]) for name in self.ends()])
        if "time_constant" in parameters:
            return np.array([float(parameters["time_constant"]), 0.0, 0.0]), values
        return np.array([0.0, *(float(parameters[f"{end}_temperature"]) for end in ("initial", "final"))]), values


def by_temperature(theta: Array) -> bool:
    """Whether a course goes with the temperature, and not with the time."""
    return bool(theta[0] <= 0.0)


def course(signals: Signals, joint: int, theta: Array) -> Array:
    """(samples,) what is left of the way from the first value to the last; a half where the temperature that it goes
    with is not known."""
    if not by_temperature(theta):
        return np.asarray(np.exp(-signals.t / theta[0]))
    temperature = np.full(signals.samples, np.nan) if signals.temperature is None else signals.temperature[:, joint]
    cold, warm = theta[1:3]
    return np.asarray(np.where(np.isfinite(temperature), (warm - temperature) / (warm - cold), UNKNOWN))
