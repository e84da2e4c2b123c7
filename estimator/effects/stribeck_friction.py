"""Stribeck friction: a joint that rubs more while it moves slowly."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

VELOCITIES = (0.03, 0.08, 0.2, 0.5)
"""Stribeck velocities to try, as shares of the joint's rms speed."""
SIGN_TO_VELOCITY = 0.05
"""Width of the sign, as a share of the Stribeck velocity: sharp where the friction rises, and no sharper."""


class StribeckFriction(JointEffect):
    """(c + (s−c)·exp(−(dq/v)²))·sign(dq) + b·dq; theta is v."""

    name = "stribeck_friction"
    dry = True
    in_drive = True
    units: ClassVar = {"level": "N·m", "breakaway": "N·m", "velocity": "rad/s", "coefficient": "N·m·s/rad"}
    confused_with = ("viscous_friction", "presliding", "coulomb_friction")
    contains = ("coulomb_friction", "viscous_friction")
    named_for = (1,)
    least_part = 0.1
    typical: ClassVar = {"coulomb_friction": (0.0, 1.0, 0.0)}
    seen_against = "dq"
    experiment = "move {joint} in slow ramps, from rest to well above the Stribeck velocity, both ways"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.asarray(np.array(VELOCITIES) * scales.dq[self.joint(place)])[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint, velocity = self.joint(place), float(theta[0])
        speed, sign = signals.dq[:, joint], signals.direction(joint, SIGN_TO_VELOCITY * velocity)
        return np.stack([sign, sign * np.exp(-((speed / velocity) ** 2)), speed], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(3)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        level, rise, viscous = map(float, coefficients)
        return {"level": level, "breakaway": level + rise, "velocity": float(theta[0]), "coefficient": viscous}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        level, breakaway, velocity, viscous = (float(parameters[name]) for name in self.units)
        return np.array([velocity]), np.array([level, breakaway - level, viscous])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        joint = self.joint(place)
        (velocity,), (level, rise, viscous) = self.unknowns(place, parameters)
        plant.friction[joint] += level
        plant.viscous[joint] += viscous
        plant.rubbing.append((joint, lambda at: rise * math.exp(-((at.dq / velocity) ** 2))))


EFFECT = StribeckFriction()
