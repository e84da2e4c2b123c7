"""Base tilt: gravity is not where the model has it."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.spatial.transform import Rotation

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class BaseTilt(Effect):
    """The base stands turned by roll about its x, then pitch about its y. Linear in both angles."""

    name = "base_tilt"
    units: ClassVar = {"roll": "rad", "pitch": "rad"}
    confused_with = ("joint_spring", "torque_offset", "friction_drift")
    experiment = "turn the first joint slowly through its whole range with the arm stretched out"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place()]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        gravity = signals.body.gravity
        changes = [-np.cross(axis, gravity) for axis in np.eye(3)[:2]]
        return np.stack([signals.gravity_torque(change) for change in changes], axis=2)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"roll": float(coefficients[0]), "pitch": float(coefficients[1])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters["roll"], parameters["pitch"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        _, (roll, pitch) = self.unknowns(place, parameters)
        plant.gravity = Rotation.from_euler("xy", [roll, pitch]).inv().apply(plant.gravity)


EFFECT = BaseTilt()
