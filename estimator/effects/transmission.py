"""A transmission that gives: motor on one side, link on the other, and an encoder on either."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.effects.signals import Signals
from estimator.twin.plant import Series

Array = NDArray[np.float64]

ON_MOTOR, ON_LINK, MOTOR_BESIDE = 0.0, 1.0, 2.0
"""Sides of an encoder, as an entry of theta. The last is on the link too, of a joint whose motor's inertia is known and
is no part of the model's bodies: told in kg·m² where the others have the motor's share."""
SIDES = (ON_MOTOR, ON_LINK, MOTOR_BESIDE)
SHARES = (0.1, 0.5)
"""Of the joint's own inertia, the motor's part to try: a recording of the link alone hardly tells it."""

IN_THE_LINK = (0.3, 0.6)
"""Of the joint's own inertia, the motor's part to try where the encoder is on it, beside none."""


@dataclass(frozen=True)
class Transmission:
    """One joint's, along one motion."""

    motor_inertia: float
    """kg·m²"""
    link_inertia: Array
    """(samples,) kg·m²"""
    torque: Array
    """(samples,) N·m that the link needs through the transmission, for the measured motion."""
    link_side: bool
    """Where the encoder is."""

    @classmethod
    def of(cls, signals: Signals, joint: int, share: float, side: float) -> Transmission:
        """``share`` of the joint's own inertia in the model, of its mean along the motion, is the motor's; of a motor
        beside the model it is the inertia."""
        # A body that was fitted (`observed.first_body`) may have a negative one: nothing swings on that.
        inertia = signals.sensitivity[2][:, joint, joint]
        if side == MOTOR_BESIDE:
            return cls(share, np.maximum(inertia, 0.0), signals.tau_rigid[:, joint], link_side=True)
        motor = share * max(float(np.mean(inertia)), 0.0)
        torque = signals.tau_rigid[:, joint] - motor * signals.ddq[:, joint]
        return cls(motor, np.maximum(inertia - motor, 0.0), torque, side == ON_LINK)

    def torque_of(self, signals: Signals, joint: int, ahead: Array) -> Array:
        """(samples, n) torque beside the rigid model's when the motor is ``ahead`` (samples,) rad of the link."""
        own = self.motor_inertia * signals.slope(signals.slope(ahead))
        # An encoder on the motor: the link's torques are those of the link's angle.
        result = np.zeros_like(signals.q) if self.link_side else -signals.by_angle_error(joint, ahead)
        result[:, joint] += own
        return result


def in_series(share: float, side: float, *, stiffness: float = 0.0, damping: float = 0.0, gap: float = 0.0) -> Series:
    """The twin's elements of a transmission with this ``share`` of theta, and ``side``."""
    motor_share = 0.0 if side == MOTOR_BESIDE else share
    return Series(stiffness, damping, gap, motor_share, link_side=side != ON_MOTOR)
