"""Joint elasticity: a spring and a damper between the motor and the link."""

from __future__ import annotations

import math
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.second_order import second_order_lag
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft, Series

Array = NDArray[np.float64]

TO_BAND = (0.3, 1.0, 3.0, 10.0)
"""Resonances to try, as multiples of the band in which torques are compared."""
RATIOS = (0.03, 0.3)
"""Damping ratios to try."""


class JointElasticity(JointEffect):
    """The angle is measured at the motor; the link lags by δ, which makes the model's torques those at q − δ:

        M·δ'' + d·δ' + k·δ = tau of the given model,  M the joint's own inertia, its mean along the motion.

    theta is k and the relaxation time d/k; they place resonance and damping. The coefficient is a free factor on δ, so
    that below the resonance, where only the size of δ tells, the stiffness is linear: k over the coefficient.
    """

    name = "joint_elasticity"
    units: ClassVar = {"stiffness": "N·m/rad", "damping": "N·m·s/rad"}
    confused_with = ("transport_delay", "rotor_inertia", "backlash", "joint_elasticity of a neighbour")
    experiment = "let {joint} alone swing in a chirp up to its resonance"

    def grid(self, place: Place, scales: Scales) -> Array:
        joint = self.joint(place)
        inertia = scales.tau[joint] / scales.ddq[joint]
        frequencies = [2.0 * np.pi * scales.band * share for share in TO_BAND]
        return np.array([[inertia * w**2, 2.0 * ratio / w] for w in frequencies for ratio in RATIOS])

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        stiffness, relaxation = map(float, theta)
        inertia = float(np.mean(signals.sensitivity[2][:, joint, joint]))
        lag = second_order_lag(signals.tau_rigid[:, joint], signals.period, relaxation, inertia / stiffness) / stiffness
        return -signals.by_angle_error(joint, lag)[:, :, None]

    def limits(self, place: Place, scales: Scales) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        stiffness = float(theta[0] / coefficients[0]) if coefficients[0] > 0.0 else math.inf
        return {"stiffness": stiffness, "damping": float(theta[1]) * stiffness}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        stiffness, damping = (float(parameters[name]) for name in self.units)
        if math.isinf(stiffness):
            return np.array([1.0, 0.0]), np.zeros(1)
        return np.array([stiffness, damping / stiffness]), np.ones(1)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        stiffness, damping = (float(parameters[name]) for name in self.units)
        plant.add_series(self.joint(place), Series(stiffness=stiffness, damping=damping))


EFFECT = JointElasticity()
