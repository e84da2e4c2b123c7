"""Presliding: after a reversal friction builds up over a small angle, as a spring that yields (Dahl 1968)."""

from __future__ import annotations

import math
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import Instant, PlantDraft

Array = NDArray[np.float64]

DISTANCES = (1e-4, 5e-4, 2e-3, 8e-3, 3e-2, 0.1, 0.4)
"""rad over which friction turns round, to try; at least a hundred-thousandth of the joint's range."""
_LONGEST = 0.1
"""rad; what yields over a longer way is no friction."""


class Presliding(JointEffect):
    """F' = (level − F·sign(dq))·|dq|/δ with δ = level/stiffness, the presliding distance, which is theta."""

    name = "presliding"
    dry = True
    in_drive = True
    units: ClassVar = {"stiffness": "N·m/rad", "level": "N·m"}
    above_zero = ("stiffness", "level")
    known_up_to = (_LONGEST,)
    mends_below = 5e-4
    beyond_known = "a function of travel since reversals, as of a hose or a cable that gives"
    confused_with = ("backlash", "transport_delay", "stribeck_friction", "coulomb_friction")
    contains = ("coulomb_friction",)
    seen_against = "dq"
    experiment = "reverse {joint} over a few milliradians, at several speeds"

    def grid(self, place: Place, scales: Scales) -> Array:
        joint = self.joint(place)
        least = 1e-5 * float(scales.q_high[joint] - scales.q_low[joint])
        return np.unique(np.maximum(DISTANCES, least))[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return bristle(signals.q[:, self.joint(place)], float(theta[0]))[:, None, None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"stiffness": float(coefficients[0] / theta[0]), "level": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        level, stiffness = float(parameters["level"]), float(parameters["stiffness"])
        # Without friction there is no distance over which it turns; any will do.
        return np.array([level / stiffness if level > 0.0 else DISTANCES[0]]), np.array([level])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        (distance,), (level,) = self.unknowns(place, parameters)
        plant.spending.append((self.joint(place), Bristle(float(level), float(distance))))


def bristle(q: Array, distance: float) -> Array:
    """(samples,) friction in units of its level along angles (samples,), slack at the start.

    Exact between samples: within a run of one direction s the bristle decays as f = s + (f₀ − s)·exp(−|q − q₀|/δ).
    """
    step = np.sign(np.diff(q))
    moving = np.flatnonzero(step)
    result = np.zeros(len(q))
    if not len(moving):
        return result
    turns = moving[1:][step[moving[1:]] != step[moving[:-1]]]
    edges = [int(moving[0]), *turns.tolist(), len(q) - 1]
    for first, last in pairwise(edges):
        run, sign = slice(first, last + 1), step[first]
        result[run] = sign + (result[first] - sign) * np.exp(-np.abs(q[run] - q[first]) / distance)
    return result


class Bristle:
    """The same law step by step."""

    def __init__(self, level: float, distance: float) -> None:
        self.level, self.distance = level, distance
        self._friction = 0.0
        self._q: float | None = None

    def __call__(self, at: Instant) -> float:
        """N·m that the motor spends."""
        moved = 0.0 if self._q is None else at.q - self._q
        self._q = at.q
        sign = math.copysign(1.0, moved)
        self._friction = sign + (self._friction - sign) * math.exp(-abs(moved) / self.distance)
        return self.level * self._friction


EFFECT = Presliding()
