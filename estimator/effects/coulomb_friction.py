"""Coulomb friction: c·sign(dq), the sign as sharp as the motion shows it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

SHARP = 1e-3
"""Width of the sigmoid that stands for the sign, rad/s, in a model."""
WIDTHS = (0.0005, 0.003, 0.02, 0.08)
"""Widths to try, as shares of the joint's rms speed."""


class CoulombFriction(JointEffect):
    """theta is the width of the sigmoid tanh(dq/width): presliding makes the sign of a real joint soft. It is fitted
    so that a soft sign is not taken for another effect, and is no parameter of the catalogue."""

    name = "coulomb_friction"
    dry = True
    in_drive = True
    units: ClassVar = {"level": "N·m"}
    hidden = (0,)
    confused_with = ("viscous_friction", "stribeck_friction", "presliding")
    seen_against = "dq"
    experiment = "move {joint} at six or more constant speeds, both ways"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.asarray(np.array(WIDTHS) * scales.dq[self.joint(place)])[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.direction(self.joint(place), float(theta[0]))[:, None, None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"level": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array([SHARP]), np.array([parameters["level"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.friction[self.joint(place)] += parameters["level"]


EFFECT = CoulombFriction()
