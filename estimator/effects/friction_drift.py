"""Friction drift: the friction level goes from one value to another while a joint runs in, or with its temperature."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.effect import JointEffect, Parameters, Place, SeenAgainst
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import Instant, PlantDraft

Array = NDArray[np.float64]

SHORTEST = 0.2
"""Of the time constants to try, as a share of the longest recording …"""
SHORTEST_S = 4.0
"""… but no less: nothing that a joint's work warms or wears in changes sooner, and in the time of a single stroke any
law of friction looks like a change."""
_UNKNOWN = 0.5
"""Of the way from the coldest to the warmest, where a joint of unknown temperature is."""


class FrictionDrift(JointEffect):
    """(final + (initial − final)·exp(−t/T))·sign(dq), t from the recording's start; or, where the joint's temperature
    was recorded and changes, straight between the levels at the coldest and at the warmest. theta is T, which is zero
    of the second law, the sign's width, and the two temperatures, which are zero of the first.

    Of a motion that is only planned, and in the twin, the joint is half as warm as it gets."""

    name = "friction_drift"
    dry = True
    in_drive = True
    units: ClassVar = {
        "initial": "N·m",
        "final": "N·m",
        "time_constant": "s",
        "initial_temperature": "°C",
        "final_temperature": "°C",
    }
    hidden = (1,)
    choices = (2, 3)
    named_for = (0, 1)
    confused_with = ("torque_offset", "coulomb_friction")
    levels = (0, 1)
    contains = ("coulomb_friction",)
    seen_against = "t"
    experiment = "repeat the first motion of {joint} last, after some minutes of work"

    def grid(self, place: Place, scales: Scales) -> Array:
        widths = np.array(WIDTHS) * scales.dq[self.joint(place)]
        first = max(SHORTEST * scales.duration, SHORTEST_S)
        times = np.geomspace(first, max(scales.duration, 2.0 * first), 3)
        rows = [[time, width, 0.0, 0.0] for time in times for width in widths]
        joint = self.joint(place)
        if scales.warms(joint):
            rows += [[0.0, width, scales.cold[joint], scales.warm[joint]] for width in widths]
        return np.array(rows)

    def seen_at(self, theta: Array) -> SeenAgainst:
        return "temperature" if _by_temperature(theta) else "t"

    def told_by_repeats(self, theta: Array) -> bool:
        return not _by_temperature(theta)

    def redundant(self, theta: Array) -> int:
        return 2 if _by_temperature(theta) else 0

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        sign = signals.direction(joint, float(theta[1]))
        left = _colder(signals, joint, *theta[2:]) if _by_temperature(theta) else np.exp(-signals.t / theta[0])
        return np.stack([sign * left, sign * (1.0 - left)], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        initial, final = map(float, coefficients)
        levels = {"initial": initial, "final": final}
        if _by_temperature(theta):
            return levels | {"initial_temperature": float(theta[2]), "final_temperature": float(theta[3])}
        return levels | {"time_constant": float(theta[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        levels = np.array([float(parameters["initial"]), float(parameters["final"])])
        if "time_constant" in parameters:
            return np.array([float(parameters["time_constant"]), SHARP, 0.0, 0.0]), levels
        ends = (float(parameters[name]) for name in ("initial_temperature", "final_temperature"))
        return np.array([0.0, SHARP, *ends]), levels

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        (time, *_), (initial, final) = self.unknowns(place, parameters)
        plant.friction[self.joint(place)] += final

        def more(at: Instant) -> float:
            return float((initial - final) * (math.exp(-at.t / time) if time > 0.0 else _UNKNOWN))

        plant.rubbing.append((self.joint(place), more))


def _by_temperature(theta: Array) -> bool:
    return bool(theta[0] <= 0.0)


def _colder(signals: Signals, joint: int, cold: float, warm: float) -> Array:
    """(samples,) how far a joint is from the warmest, as a share; a half where its temperature is not known."""
    temperature = np.full(signals.samples, np.nan) if signals.temperature is None else signals.temperature[:, joint]
    return np.asarray(np.where(np.isfinite(temperature), (warm - temperature) / (warm - cold), _UNKNOWN))


EFFECT = FrictionDrift()
