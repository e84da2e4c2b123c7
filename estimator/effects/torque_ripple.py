"""Torque ripple: the motor's torque varies with its angle, tau·a·sin(k·q + φ)."""

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


_MOST = 0.9
"""Of a torque, what ripple takes of it at the most."""


class TorqueRipple(JointEffect):
    """theta is the order k, then the two coefficients. The torque that a joint needs is tau less the
    ripple: tau is that divided by 1 − a·sin(k·q + φ)."""

    name = "torque_ripple"
    in_drive = True
    of_motor = True
    units: ClassVar = {"order": "1/turn", "amplitude": "–", "phase": "rad"}
    about = (1, 2)
    recurs = True
    beyond_known = "a function of the torque and the angle, of which no period is seen"
    confused_with = ("cogging",)
    experiment = "sweep {joint} slowly through its range, under two loads"

    def grid(self, place: Place, scales: Scales) -> Array:
        return _small(orders(scales, self.joint(place)))

    def finer(self, place: Place, scales: Scales) -> Array:
        return _small(fine_orders(scales, self.joint(place)))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return next(self.columns_of_each(place, signals, [theta]))

    def columns_of_each(self, place: Place, signals: Signals, thetas: Sequence[Array]) -> Iterator[Array]:
        joint = self.joint(place)
        turned = signals.dq[:, joint] * signals.period
        each = each_quadratures([float(theta[0]) for theta in thetas], signals.q[:, joint], turned)
        for theta, waves in zip(thetas, each, strict=True):
            left = 1.0 - np.minimum(waves @ theta[1:], _MOST) if theta[1:].any() else 1.0
            yield ((signals.tau_motor[:, joint] / left)[:, None] * waves)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        """A motor whose torque turned its sign over within a turn would not drive the joint."""
        return -np.ones(2), np.ones(2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        amplitude, phase = amplitude_and_phase(coefficients)
        return {"order": float(theta[0]), "amplitude": amplitude, "phase": phase}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        order, amplitude, phase = (float(parameters[name]) for name in self.units)
        coefficients = coefficients_of(amplitude, phase)
        return np.array([order, *coefficients]), coefficients

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        order, amplitude, phase = (float(parameters[name]) for name in self.units)
        plant.spending.append((self.joint(place), lambda at: at.motor * amplitude * math.sin(order * at.q + phase)))


def _small(orders: Array) -> Array:
    """(k, 3) theta of ripples that are small."""
    return np.stack([orders, np.zeros(len(orders)), np.zeros(len(orders))], axis=1)


EFFECT = TorqueRipple()
