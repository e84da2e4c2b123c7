"""Backlash: a dead band between motor and link."""

from __future__ import annotations

import math
from collections.abc import Mapping
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
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

GAPS = (3e-5, 3e-4, 3e-3, 1e-2, 3e-2)
"""rad, to try."""
_AS_WIDE = 0.3
"""Of the gap that a shape was made of, the least that it can be: one that is crossed as slowly as a gap of 10 mrad is
none of a tenth of a milliradian."""


class Backlash(JointEffect):
    """The motor lies half a gap ahead of the link or behind it, on the side on which the torque presses; when that
    changes its sign the gap is crossed in free flight, which takes the longer the wider it is. The encoder sits on
    either of them, as with `joint_elasticity`:

        encoder on the motor:  the link's torques are those at q − δ; the link falls behind by what it needs
        encoder on the link:   the motor spends J·δ'' more, and flies ahead by the torque that it has

    theta is the gap, the motor's share of the joint's inertia and the encoder's side; the coefficient is the gap too,
    as the factor on what the column has per unit. A URDF's bodies are the links alone, those of a model that was
    identified hold the rotors too: both are tried for an encoder on the motor, for the gap is told too small by the
    rotor's share where that is taken for the link's."""

    name = "backlash"
    units: ClassVar = {"gap": "rad"}
    hidden = (1, 2)
    choices = (2,)
    exact_to = 0.2
    confused_with = ("presliding", "joint_elasticity")
    experiment = "reverse {joint} where gravity loads it, and where it does not"

    def choices_at(self, place: Place) -> Mapping[int, tuple[float, ...]]:
        return {2: SIDES}

    def grid(self, place: Place, scales: Scales) -> Array:
        at_motor = [[gap, share, ON_MOTOR] for gap in GAPS for share in (0.0, *IN_THE_LINK)]
        at_link = [[gap, SHARES[k % len(SHARES)], ON_LINK] for k, gap in enumerate(GAPS)]
        return np.array(at_motor + at_link)

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return tuple(range(body.n))

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        gap, share, side = map(float, theta)
        transmission = Transmission.of(signals, joint, share, side)
        pressing, flying = transmission.torque, transmission.link_inertia
        if transmission.link_side:
            # A link in flight shows no torque, only the blow at its end; what the motor was given says how it flew.
            flying = np.full(signals.samples, transmission.motor_inertia)
            if signals.tau is not None:
                pressing = signals.tau[:, joint] - flying * signals.ddq[:, joint]
        if np.min(flying) <= 0.0:
            # A model without bodies says nothing of how a gap is crossed.
            return np.zeros((signals.samples, signals.body.n, 1))
        ahead = play(pressing / flying, signals.period, gap)
        return transmission.torque_of(signals, joint, ahead / gap)[:, :, None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.array([_AS_WIDE * theta[0]]), np.array([np.inf])

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gap": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        gap = float(parameters["gap"])
        return np.array([gap if gap > 0.0 else GAPS[0], 0.0, ON_MOTOR]), np.array([gap])

    def with_motor(self, theta: Array, inertia: float) -> Array | None:
        return None if theta[2] == ON_MOTOR else np.array([theta[0], inertia, MOTOR_BESIDE])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        self.simulate_fitted(place, parameters, plant, None)

    def simulate_fitted(self, place: Place, parameters: Parameters, plant: PlantDraft, shape: Array | None) -> None:
        share, side = (0.0, ON_MOTOR) if shape is None else map(float, shape)
        plant.add_series(self.joint(place), in_series(share, side, gap=float(parameters["gap"])))


def play(acceleration: Array, period: float, gap: float) -> Array:
    """(samples,) rad by which the motor is ahead of the link, ±gap/2 in contact.

    ``acceleration`` (samples,): of the motor against the link in free flight, rad/s², which has the sign of the torque
    that the link needs. Impacts do not bounce.
    """
    side = 1.0 if acceleration[0] >= 0.0 else -1.0
    result = np.empty(len(acceleration))
    result[:] = side * gap / 2.0
    turns = np.flatnonzero(np.diff(np.signbit(acceleration))) + 1
    k = 0
    for turn in turns:
        if turn < k or acceleration[turn] * side > 0.0:
            continue
        k, ahead, speed = int(turn), side * gap / 2.0, 0.0
        while k < len(acceleration) and abs(ahead) <= gap / 2.0:
            result[k] = ahead
            speed += period * float(acceleration[k])
            ahead += period * speed
            k += 1
        side = math.copysign(1.0, ahead)
        result[k:] = side * gap / 2.0
    return result


EFFECT = Backlash()
