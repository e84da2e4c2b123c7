"""Stribeck friction: a joint that rubs more while it moves slowly."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.coulomb_friction import SHARP
from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

SQUARE = 2.0
"""The exponent of most papers."""
SHAPES = (
    *((velocity, SQUARE, 0.0005) for velocity in (0.03, 0.08, 0.2, 0.5, 1.0)),
    *((velocity, SQUARE, 0.01) for velocity in (0.08, 0.2, 0.5, 1.0)),
    (0.2, 0.5, 0.0005),
)
"""To try: a Stribeck velocity and the width of the sign, as shares of the joint's rms speed, about an exponent."""
_FALLS = 0.1
"""Of its level, or its rise, what it falls by from rest: a friction that is no less at any speed is of another form."""
_SPEEDS = np.linspace(0.0, 5.0, 101)
"""In Stribeck velocities, where it is looked for."""


class StribeckFriction(JointEffect):
    """(c + (s−c)·exp(−|dq/v|^δ))·sign(dq) + b·dq; theta is v, δ and the width of the sign.

    The sign has a width of its own: one that goes with v makes of a motion that lingers at its reversals a small v.
    Surfaces differ in how sharply they let go: exponents from one half to two are in use (Armstrong-Hélouvry, Dupont
    and Canudas de Wit, Automatica 30(7), 1994).
    """

    name = "stribeck_friction"
    dry = True
    in_drive = True
    hidden = (2,)
    forms = (1,)
    units: ClassVar = {
        "level": "N·m",
        "breakaway": "N·m",
        "velocity": "rad/s",
        "coefficient": "N·m·s/rad",
        "exponent": "–",
    }
    above_zero = ("velocity", "exponent")
    confused_with = ("viscous_friction", "presliding", "coulomb_friction")
    contains = ("coulomb_friction", "viscous_friction")
    named_for = (1,)
    typical: ClassVar = {"coulomb_friction": (0.0, 1.0, 0.0)}
    seen_against = "dq"
    experiment = "move {joint} in slow ramps, from rest to well above the Stribeck velocity, both ways"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.asarray(np.array(SHAPES) * np.where([True, False, True], scales.dq[self.joint(place)], 1.0))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint, (velocity, exponent, width) = self.joint(place), map(float, theta)
        speed, sign = signals.dq[:, joint], signals.direction(joint, width)
        rise = sign * np.exp(-(np.abs(speed / velocity) ** exponent))
        return np.stack([sign, rise, speed], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(3)

    def differs(self, theta: Array, coefficients: Array) -> bool:
        level, rise, viscous = coefficients
        fallen = rise * (1.0 - np.exp(-(_SPEEDS ** theta[1]))) - viscous * theta[0] * _SPEEDS
        return bool(np.max(fallen) >= _FALLS * max(level, rise))

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        level, rise, viscous = map(float, coefficients)
        velocity, exponent = map(float, theta[:2])
        return {
            "level": level,
            "breakaway": level + rise,
            "velocity": velocity,
            "coefficient": viscous,
            "exponent": exponent,
        }

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        level, breakaway, viscous = (float(parameters[name]) for name in ("level", "breakaway", "coefficient"))
        theta = np.array([parameters["velocity"], parameters.get("exponent", SQUARE), SHARP], dtype=float)
        return theta, np.array([level, breakaway - level, viscous])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        joint = self.joint(place)
        (velocity, exponent, _), (level, rise, viscous) = self.unknowns(place, parameters)
        plant.friction[joint] += level
        plant.viscous[joint] += viscous
        plant.rubbing.append((joint, lambda at: rise * math.exp(-(abs(at.dq / velocity) ** exponent))))


EFFECT = StribeckFriction()
