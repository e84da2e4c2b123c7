"""Joint spring: k·(q − q0) of a cable, a hose or a counterbalance."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class JointSpring(JointEffect):
    """The stiffness may be negative: a counterbalance pushes away from where it is in line with the arm."""

    name = "joint_spring"
    momentary = True
    units: ClassVar = {"stiffness": "N·m/rad", "centre": "rad"}
    confused_with = ("base_tilt", "joint_elasticity", "torque_offset")
    contains = ("torque_offset",)
    bends = True
    seen_against = "q"
    experiment = "rest in a grid of poses over the range of {joint}"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        q = signals.q[:, self.joint(place)]
        return np.stack([q, np.ones_like(q)], axis=1)[:, None, :]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        stiffness, moment = map(float, coefficients)
        return {"stiffness": stiffness, "centre": -moment / stiffness if stiffness else 0.0}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        stiffness, centre = float(parameters["stiffness"]), float(parameters["centre"])
        return np.zeros(0), np.array([stiffness, -stiffness * centre])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        plant.add_spring(self.joint(place), float(parameters["stiffness"]), float(parameters["centre"]))


EFFECT = JointSpring()
