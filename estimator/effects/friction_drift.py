"""Friction drift: the friction level goes from one value to another while the joint runs in or warms up."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

SHORTEST = 0.2
"""Of the time constants to try, as a share of the longest recording …"""
SHORTEST_S = 4.0
"""… but no less: nothing that a joint's work warms or wears in changes sooner, and in the time of a single stroke any
law of friction looks like a change."""


class FrictionDrift(JointEffect):
    """(final + (initial − final)·exp(−t/T))·sign(dq), t from the recording's start; theta is T and the sign's width."""

    name = "friction_drift"
    dry = True
    in_drive = True
    units: ClassVar = {"initial": "N·m", "final": "N·m", "time_constant": "s"}
    hidden = (1,)
    named_for = (0, 1)
    confused_with = ("torque_offset", "coulomb_friction")
    levels = (0, 1)
    contains = ("coulomb_friction",)
    told_by_repeats = True
    seen_against = "t"
    experiment = "repeat the first motion of {joint} last, after some minutes of work"

    def grid(self, place: Place, scales: Scales) -> Array:
        widths = np.array(WIDTHS) * scales.dq[self.joint(place)]
        first = max(SHORTEST * scales.duration, SHORTEST_S)
        times = np.geomspace(first, max(scales.duration, 2.0 * first), 3)
        return np.array([[time, width] for time in times for width in widths])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        sign = signals.direction(self.joint(place), float(theta[1]))
        left = np.exp(-signals.t / theta[0])
        return np.stack([sign * left, sign * (1.0 - left)], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        initial, final = map(float, coefficients)
        return {"initial": initial, "final": final, "time_constant": float(theta[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        initial, final, time = (float(parameters[name]) for name in self.units)
        return np.array([time, SHARP]), np.array([initial, final])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        (time, _), (initial, final) = self.unknowns(place, parameters)
        plant.friction[self.joint(place)] += final
        plant.rubbing.append((self.joint(place), lambda at: (initial - final) * math.exp(-at.t / time)))


EFFECT = FrictionDrift()
