"""Cogging: magnets pull the rotor towards the teeth, a·sin(k·q + φ), whatever the torque."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.effects.waves import amplitude_and_phase, coefficients_of, each_quadratures, fine_orders, orders
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class Cogging(JointEffect):
    """theta is the order k, periods a turn of the joint."""

    name = "cogging"
    in_drive = True
    units: ClassVar = {"order": "1/turn", "amplitude": "N·m", "phase": "rad"}
    recurs = True
    beyond_known = "a function of the angle, of which no period is seen"
    looks_like = ("joint_spring", "torque_offset", "contact", "base_tilt")
    confused_with = ("encoder_eccentricity", "torque_ripple")
    seen_against = "q"
    experiment = "sweep {joint} slowly through full turns, both ways"

    def grid(self, place: Place, scales: Scales) -> Array:
        return orders(scales, self.joint(place))[:, None]

    def finer(self, place: Place, scales: Scales) -> Array:
        return fine_orders(scales, self.joint(place))[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return next(self.columns_of_each(place, signals, [theta]))

    def columns_of_each(self, place: Place, signals: Signals, thetas: Sequence[Array]) -> Iterator[Array]:
        joint = self.joint(place)
        turned = signals.dq[:, joint] * signals.period
        for waves in each_quadratures([float(theta[0]) for theta in thetas], signals.q[:, joint], turned):
            yield waves[:, None, :]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        amplitude, phase = amplitude_and_phase(coefficients)
        return {"order": float(theta[0]), "amplitude": amplitude, "phase": phase}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        order, amplitude, phase = (float(parameters[name]) for name in self.units)
        return np.array([order]), coefficients_of(amplitude, phase)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        order, amplitude, phase = (float(parameters[name]) for name in self.units)
        plant.spending.append((self.joint(place), lambda at: amplitude * math.sin(order * at.q + phase)))


EFFECT = Cogging()
