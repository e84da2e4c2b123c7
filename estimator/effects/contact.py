"""Contact: for a while something pushes on the arm."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft, Push

Array = NDArray[np.float64]

SHARES = 12
"""The recording's halves of windows: those tried are two of them long and begin at each."""
EDGE = 0.02
"""s over which the force comes and goes."""


class Contact(Effect):
    """A constant force (3,) N on the arm, in the base's frame, at the origin of the last link. ``where`` is from when
    until when, s since the recording's start, which are theta."""

    name = "contact"
    units: ClassVar = {"where": "s", "force": "N"}
    confused_with = ("load_dependent_friction", "friction_drift")
    experiment = "play the same path again, shifted by 5 cm"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place()]

    def grid(self, place: Place, scales: Scales) -> Array:
        starts = np.arange(SHARES - 1) * scales.duration / SHARES
        return np.stack([starts, starts + 2.0 * scales.duration / SHARES], axis=1)

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        start, end = map(float, theta)
        during = 0.5 * (np.tanh((signals.t - start) / EDGE) - np.tanh((signals.t - end) / EDGE))
        return np.asarray(-during[:, None, None] * signals.reach)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"where": np.array(theta), "force": np.array(coefficients)}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.array(parameters["where"], dtype=float), np.array(parameters["force"], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        (start, end), force = self.unknowns(place, parameters)
        plant.pushes.append(Push(force, float(start), float(end)))


EFFECT = Contact()
