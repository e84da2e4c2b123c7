"""Friction drift: a joint's friction goes from one value to another while it runs in, or with its temperature."""

from __future__ import annotations

import math
from collections.abc import Callable, Collection
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.drift import COURSE, UNKNOWN, Drift, by_temperature
from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import Instant, PlantDraft

Array = NDArray[np.float64]


class FrictionDrift(Drift):
    """The level of a dry friction that drifts; theta is `Drift`'s, and the width of the sign.

    The name's other law is `ViscousDrift`."""

    name = "friction_drift"
    dry = True
    in_drive = True
    units: ClassVar = {"initial": "N·m", "final": "N·m"} | COURSE
    hidden = (3,)
    confused_with = ("torque_offset", "coulomb_friction")
    contains = ("coulomb_friction",)
    experiment = "repeat the first motion of {joint} last, after some minutes of work"

    def laws(self) -> tuple[Effect, ...]:
        return (self, VISCOUS)

    def of(self, parameters: Collection[str]) -> Effect:
        return VISCOUS if set(VISCOUS.ends()) & set(parameters) else self

    def grid(self, place: Place, scales: Scales) -> Array:
        widths = np.array(WIDTHS) * scales.dq[self.joint(place)]
        return np.array([[*course, width] for course in self.courses(place, scales) for width in widths])

    def carrier(self, place: Place, signals: Signals, shape: Array) -> Array:
        return signals.direction(self.joint(place), float(shape[0]))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        course, levels = super().unknowns(place, parameters)
        return np.append(course, SHARP), levels

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        theta, (initial, final) = self.unknowns(place, parameters)
        left = _in_the_twin(theta)
        plant.friction[self.joint(place)] += final
        plant.rubbing.append((self.joint(place), lambda at: (initial - final) * left(at)))


class ViscousDrift(Drift):
    """The coefficient of a viscous friction that drifts: grease is thinner when it is warm."""

    name = "friction_drift"
    in_drive = True
    units: ClassVar = {"initial_coefficient": "N·m·s/rad", "final_coefficient": "N·m·s/rad"} | COURSE
    confused_with = ("viscous_friction",)
    contains = ("viscous_friction",)
    experiment = FrictionDrift.experiment

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array(self.courses(place, scales))

    def carrier(self, place: Place, signals: Signals, shape: Array) -> Array:
        return signals.dq[:, self.joint(place)]

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        theta, (initial, final) = self.unknowns(place, parameters)
        left = _in_the_twin(theta)
        plant.viscous[self.joint(place)] += final
        plant.spending.append((self.joint(place), lambda at: (initial - final) * left(at) * at.dq))


def _in_the_twin(theta: Array) -> Callable[[Instant], float]:
    """What is left of the way from the first value to the last."""
    if by_temperature(theta):
        return lambda at: UNKNOWN
    time = float(theta[0])
    return lambda at: math.exp(-at.t / time)


VISCOUS = ViscousDrift()
EFFECT = FrictionDrift()
