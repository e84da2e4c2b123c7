"""Asymmetric friction: Coulomb and viscous friction with other values for dq < 0."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP, WIDTHS
from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class AsymmetricFriction(JointEffect):
    """c₊·(s + 1)/2 + b₊·dq₊ + c₋·(s − 1)/2 + b₋·dq₋ with s the sign of `coulomb_friction`; ₊ and ₋ are the parts above
    and below zero. theta is the sign's width.

    Between both ways the friction is halfway between its levels, as that of a symmetric one beside an offset is: what a
    joint does while it turns round tells neither from the other. Of one that never goes either way there is none.
    """

    name = "asymmetric_friction"
    dry = True
    in_drive = True
    units: ClassVar = {
        "level_positive": "N·m",
        "level_negative": "N·m",
        "coefficient_positive": "N·m·s/rad",
        "coefficient_negative": "N·m·s/rad",
    }
    hidden = (0,)
    confused_with = ("torque_offset", "stribeck_friction")
    levels = (0, 1)
    contains = ("coulomb_friction", "viscous_friction")
    made_with = ("torque_offset",)
    typical: ClassVar = {"coulomb_friction": (0.4, -0.4, 0.0, 0.0), "viscous_friction": (0.0, 0.0, 0.4, -0.4)}
    seen_against = "dq"
    experiment = "move {joint} at a high constant speed, both ways, and record its torque with the drives off"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.asarray(np.array(WIDTHS) * scales.dq[self.joint(place)])[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        sign, speed = signals.direction(joint, float(theta[0])), signals.dq[:, joint]
        goes = float(np.max(np.abs(sign)) > 0.5)
        halves = [goes * (sign + 1.0) / 2.0, goes * (sign - 1.0) / 2.0, np.maximum(speed, 0.0), np.minimum(speed, 0.0)]
        return np.stack(halves, axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(4)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(self.units, map(float, coefficients), strict=True))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array([SHARP]), np.array([parameters[name] for name in self.units], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        joint = self.joint(place)
        _, (level, level_back, viscous, viscous_back) = self.unknowns(place, parameters)
        mean = (level + level_back) / 2.0
        plant.friction[joint] += mean
        plant.rubbing.append((joint, lambda at: level - mean if at.dq > 0.0 else level_back - mean))
        plant.viscous[joint] += min(viscous, viscous_back)
        more, more_back = viscous - min(viscous, viscous_back), viscous_back - min(viscous, viscous_back)
        plant.rubbing.append((joint, lambda at: more * at.dq if at.dq > 0.0 else -more_back * at.dq))


EFFECT = AsymmetricFriction()
