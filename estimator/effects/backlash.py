"""Backlash: a dead band between motor and link."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft, Series

Array = NDArray[np.float64]

GAPS = (3e-5, 3e-4, 3e-3, 1e-2)
"""rad, to try."""


class Backlash(JointEffect):
    """The angle is measured at the motor; the link lies half a gap behind or ahead of it, on the side to which the
    torque presses it. When the torque changes its sign the link crosses the gap in free flight, so how fast depends on
    the gap, which is theta; the coefficient is the gap too, as the factor on what the column has per unit."""

    name = "backlash"
    units: ClassVar = {"gap": "rad"}
    confused_with = ("presliding", "joint_elasticity")
    experiment = "reverse {joint} where gravity loads it, and where it does not"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array(GAPS)[:, None]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint, gap = self.joint(place), float(theta[0])
        inertia = float(np.mean(signals.sensitivity[2][:, joint, joint]))
        if inertia <= 0.0:
            # A model without bodies says nothing of how a gap is crossed.
            return np.zeros((signals.samples, signals.body.n, 1))
        ahead = play(signals.tau_rigid[:, joint] / inertia, signals.period, gap)
        return -signals.by_angle_error(joint, ahead / gap)[:, :, None]

    def limits(self, place: Place, scales: Scales) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gap": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        gap = float(parameters["gap"])
        return np.array([gap if gap > 0.0 else GAPS[0]]), np.array([gap])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.add_series(self.joint(place), Series(gap=float(parameters["gap"])))


def play(acceleration: Array, period: float, gap: float) -> Array:
    """(samples,) rad by which the motor is ahead of the link, ±gap/2 in contact.

    ``acceleration`` (samples,): what the link needs over its inertia, rad/s²; in free flight it lacks that, and falls
    behind by it. Impacts do not bounce.
    """
    side = 1.0 if acceleration[0] >= 0.0 else -1.0
    result = np.empty(len(acceleration))
    result[:] = side * gap / 2.0
    turns = np.flatnonzero(np.diff(np.signbit(acceleration))) + 1
    k = 0
    for turn in turns:
        if turn < k or acceleration[turn] * side > 0.0:
            continue
        k, ahead, speed = int(turn), side * gap / 2.0, 0.0
        while k < len(acceleration) and abs(ahead) <= gap / 2.0:
            result[k] = ahead
            speed += period * float(acceleration[k])
            ahead += period * speed
            k += 1
        side = math.copysign(1.0, ahead)
        result[k:] = side * gap / 2.0
    return result


EFFECT = Backlash()
