"""Payload: a rigid body at the tool that the given model lacks."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class Payload(Effect):
    """A point mass in the last link's frame: its own inertia about its centre is beyond what one motion tells beside
    the links' tolerance. The coefficients are mass and first moment; theta is none.

    The mass at its centre also turns: inertia m·|c|² follows from the fit's own first moment to second order, and is
    left to the links' tolerance.
    """

    name = "payload"
    units: ClassVar = {"mass": "kg", "centre": "m"}
    confused_with = ("encoder_offset", "link_inertia")
    experiment = "play the same motion before and after the load is taken up"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place()]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return np.asarray(signals.regressor[:, :, -10:-6])

    def limits(self, place: Place, scales: Scales) -> tuple[Array, Array]:
        return np.array([0.0, -np.inf, -np.inf, -np.inf]), np.full(4, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        mass = float(coefficients[0])
        centre = coefficients[1:] / mass if mass > 0.0 else np.zeros(3)
        return {"mass": mass, "centre": centre}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), parameters["mass"] * np.append(1.0, parameters["centre"])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        mass, centre = float(parameters["mass"]), np.asarray(parameters["centre"], dtype=float)
        about = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        plant.parameters[-10:] += [mass, *(mass * centre), *about[np.triu_indices(3)]]


EFFECT = Payload()
