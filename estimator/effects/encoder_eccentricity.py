"""Encoder eccentricity: the disc turns out of centre, measured = true + a·sin(q + φ).

theta is 1 where speeds come from a sensor of their own, which is not out of centre, and 0 where they come from the same
disc.
"""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.effects.waves import amplitude_and_phase, coefficients_of, quadratures
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class EncoderEccentricity(JointEffect):
    name = "encoder_eccentricity"
    units: ClassVar = {"amplitude": "rad", "phase": "rad"}
    confused_with = ("cogging", "velocity_sensor_gain")
    seen_against = "q"
    hidden = (0,)
    choices = (0,)
    experiment = "turn {joint} slowly through full turns, both ways"

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[0.0], [1.0]])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        waves = quadratures(signals.q[:, joint])
        return np.stack([signals.by_angle_error(joint, -wave) for wave in waves.T], axis=2)

    def speed_rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return (self.joint(place),)

    def speed_columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return -float(theta[0]) * signals.slope(quadratures(signals.q[:, self.joint(place)]))[:, None]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(self.units, amplitude_and_phase(coefficients), strict=True))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.ones(1), coefficients_of(float(parameters["amplitude"]), float(parameters["phase"]))

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        amplitude, phase = (float(parameters[name]) for name in self.units)
        plant.angle.append((self.joint(place), lambda q: q + amplitude * math.sin(q + phase)))


EFFECT = EncoderEccentricity()
