"""Encoder eccentricity: the disc turns out of centre, measured = true + a·sin(q + φ).

theta is 1 where speeds come from a sensor of their own, which is not out of centre, and 0 where they come from the same
disc; then the two coefficients, by which the true angle is known, of which the wave is one.
"""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.effects.waves import amplitude_and_phase, coefficients_of, quadratures
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

_LARGEST = 0.3
"""rad; a disc that is farther out of centre is none that turns."""
_NEWTON_STEPS = 4


class EncoderEccentricity(JointEffect):
    name = "encoder_eccentricity"
    units: ClassVar = {"amplitude": "rad", "phase": "rad"}
    confused_with = ("cogging", "velocity_sensor_gain")
    seen_against = "q"
    hidden = (0,)
    choices = (0,)
    about = (1, 2)
    experiment = "turn {joint} slowly through full turns, both ways"

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def choices_at(self, place: Place) -> Mapping[int, tuple[float, ...]]:
        return {0: (0.0, 1.0)}

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        waves = quadratures(_true_angle(signals.q[:, joint], theta))
        columns = np.stack([signals.by_angle_error(joint, -wave) for wave in waves.T], axis=2)
        about = _turning(theta)
        if about.any():
            # Such a share of each coefficient's own torque makes the sum of both exact where they are those of theta.
            curved = signals.by_large_angle_error(joint, -waves @ about) - columns @ about
            columns += curved[:, :, None] * about / (about @ about)
        return columns

    def speed_rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return (self.joint(place),)

    def speed_columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return (
            -float(theta[0]) * signals.slope(quadratures(_true_angle(signals.q[:, self.joint(place)], theta)))[:, None]
        )

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(self.units, amplitude_and_phase(coefficients), strict=True))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        coefficients = coefficients_of(float(parameters["amplitude"]), float(parameters["phase"]))
        return np.array([1.0, *coefficients]), coefficients

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        amplitude, phase = (float(parameters[name]) for name in self.units)
        plant.angle.append((self.joint(place), lambda q: q + amplitude * math.sin(q + phase)))


def _turning(theta: Array) -> Array:
    """(2,) the coefficients that theta has."""
    return np.asarray(theta[1:] * min(1.0, _LARGEST / max(float(np.hypot(*theta[1:])), _LARGEST)))


def _true_angle(measured: Array, theta: Array) -> Array:
    """(samples,) the angle that a disc as eccentric as theta has measured so; Newton's method."""
    sine, cosine = map(float, _turning(theta))
    true = measured
    for _ in range(_NEWTON_STEPS if sine or cosine else 0):
        too_much = true + sine * np.sin(true) + cosine * np.cos(true) - measured
        true = true - too_much / (1.0 + sine * np.cos(true) - cosine * np.sin(true))
    return true


EFFECT = EncoderEccentricity()
