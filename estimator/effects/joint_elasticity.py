"""Joint elasticity: a spring and a damper between the motor and the link."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.second_order import second_order_lag, swing
from estimator.effects.signals import Scales, Signals
from estimator.effects.transmission import (
    IN_THE_LINK,
    MOTOR_BESIDE,
    ON_LINK,
    ON_MOTOR,
    SHARES,
    SIDES,
    Transmission,
    in_series,
)
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

TO_BAND = (0.3, 1.0, 3.0, 10.0)
"""Resonances to try, as multiples of the band in which torques are compared."""
RATIOS = (0.03, 0.3)
"""Damping ratios to try."""
_LEAST_SHARE = 1e-6
"""Of the joint's inertia, the motor's: without any, a link shows nothing of its spring."""


class JointElasticity(JointEffect):
    """Motor, spring and damper, link. The encoder sits on either of them; ``side`` says on which.

    τ is what the link's bodies need, M, C and G its derivatives by the joint's own acceleration, speed and angle, J the
    part of M that is the motor's, ``share`` of M's mean along the motion, and δ the angle by which the motor is ahead
    of the link. To first order in 1/k:

        encoder on the motor:  (M − J)·δ'' + (d + C)·δ' + (k + G)·δ = τ(motor's motion); the link's torques are those at
                               q − δ
        encoder on the link:   d·δ' + k·δ = τ(link's motion); the motor spends J·δ'' more

    theta is ln k, the relaxation time d/k (they place resonance and damping), ``share``, ``side``. The coefficient is a
    free factor on δ, so that below the resonance, where only the size of δ tells, the stiffness is linear: k over the
    coefficient. A URDF's bodies are the links alone, those of a model that was identified hold the rotors too: both are
    tried for an encoder on the motor. What a link encoder sees is the motor's inertia times 1/k: its coefficient is
    that over the model's own inertia, and the span of ``share`` is part of the stiffness' error, unless the motor's
    inertia is told beside the model's bodies (`with_motor`).
    """

    name = "joint_elasticity"
    units: ClassVar = {"stiffness": "N·m/rad", "damping": "N·m·s/rad"}
    hidden = (2, 3)
    choices = (3,)
    factored = True
    above_zero = ("stiffness",)
    confused_with = ("transport_delay", "rotor_inertia", "backlash", "joint_elasticity of a neighbour")
    experiment = "let {joint} alone swing in a chirp up to its resonance"

    def choices_at(self, place: Place) -> Mapping[int, tuple[float, ...]]:
        return {3: SIDES}

    def grid(self, place: Place, scales: Scales) -> Array:
        joint = self.joint(place)
        inertia = scales.tau[joint] / scales.ddq[joint]
        frequencies = [2.0 * np.pi * scales.band * share for share in TO_BAND]
        at_motor = [
            [math.log((1.0 - share) * inertia * w**2), 2.0 * ratio / w, share, ON_MOTOR]
            for w in frequencies
            for share in (0.0, *IN_THE_LINK)
            for ratio in (RATIOS[:1] if share else RATIOS)
        ]
        # Seen from the link the spring does not swing: its stiffness is only a factor, and so nearly is the share.
        w = 2.0 * np.pi * scales.band
        pairs = zip(RATIOS, SHARES, strict=True)
        at_link = [[math.log(inertia * w**2), 2.0 * ratio / w, share, ON_LINK] for ratio, share in pairs]
        return np.array(at_motor + at_link)

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        stiffness, relaxation, share, side = math.exp(theta[0]), *map(float, theta[1:])
        transmission = Transmission.of(signals, joint, share, side)
        if transmission.link_side or np.min(transmission.link_inertia) <= 0.0:
            give = second_order_lag(transmission.torque, signals.period, relaxation, 0.0) / stiffness
        else:
            by_q, by_dq, _ = signals.sensitivity
            # A pose that falls over may take half of a spring, and no more.
            restoring = stiffness + np.maximum(by_q[:, joint, joint], -0.5 * stiffness)
            damping = relaxation * stiffness + by_dq[:, joint, joint]
            give = swing(transmission.torque, signals.period, transmission.link_inertia, damping, restoring)
        return transmission.torque_of(signals, joint, give)[:, :, None] / _told_for(theta)

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def at_one(self, theta: Array, coefficients: Array) -> Array:
        """On the link's side the factor is the stiffness: nothing swings there."""
        if theta[3] != ON_MOTOR or coefficients[0] <= 0.0:
            return theta
        return np.array([theta[0] - math.log(coefficients[0]), *theta[1:]])

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        factor = float(coefficients[0]) / _told_for(theta)
        stiffness = math.exp(theta[0]) / factor if factor > 0.0 else math.inf
        return {"stiffness": stiffness, "damping": float(theta[1]) * stiffness}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        stiffness, damping = (float(parameters[name]) for name in self.units)
        if math.isinf(stiffness):
            return np.array([0.0, 0.0, 0.0, ON_MOTOR]), np.zeros(1)
        return np.array([math.log(stiffness), damping / stiffness, 0.0, ON_MOTOR]), np.ones(1)

    def fitted_unknowns(self, place: Place, parameters: Parameters, shape: Array | None) -> tuple[Array, Array]:
        theta, coefficients = super().fitted_unknowns(place, parameters, shape)
        return theta, coefficients * _told_for(theta)

    def with_motor(self, theta: Array, inertia: float) -> Array | None:
        return None if theta[3] == ON_MOTOR else np.array([*theta[:2], inertia, MOTOR_BESIDE])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        self.simulate_fitted(place, parameters, plant, None)

    def simulate_fitted(self, place: Place, parameters: Parameters, plant: PlantDraft, shape: Array | None) -> None:
        stiffness, damping = (float(parameters[name]) for name in self.units)
        share, side = (0.0, ON_MOTOR) if shape is None else map(float, shape)
        plant.add_series(self.joint(place), in_series(share, side, stiffness=stiffness, damping=damping))


def _told_for(theta: Array) -> float:
    """The motor's inertia that a coefficient of one has, in units of its column's: a share that is not told is no part
    of what is."""
    return max(float(theta[2]), _LEAST_SHARE) if theta[3] == ON_LINK else 1.0


EFFECT = JointElasticity()
