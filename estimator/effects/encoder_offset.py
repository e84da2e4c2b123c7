"""Encoder offset: the true angle is the measured one plus o."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class EncoderOffset(JointEffect):
    name = "encoder_offset"
    units: ClassVar = {"offset": "rad"}
    confused_with = ("payload", "base_tilt", "link_inertia")
    seen_against = "q"
    experiment = "rest in a grid of poses under two payloads, or hold a level to the link of {joint}"

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return signals.sensitivity[0][:, :, self.joint(place), None]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"offset": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters["offset"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.angle_offset[self.joint(place)] += parameters["offset"]


EFFECT = EncoderOffset()
