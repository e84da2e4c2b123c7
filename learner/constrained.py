"""A correction within the limits: where the wanted torque goes beyond one, the best that can be done, not its clip.

Clipping throws away impulse that the arm then lacks for the rest of the motion. The linear programme instead chooses,
among all torques within torque and rate limits whose predicted motion keeps the position and speed limits, those with
the least sum of velocity errors; they begin earlier, or end later, to make up for the limit.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import block_array, csc_array, eye_array

from config import InputError
from learner.feedback_loop import FeedbackLoop
from learner.linearisation import LinearArm

Array = NDArray[np.float64]
FEEDBACK_SHARE = 0.1
"""Of the torque limit, kept for the servo."""


@dataclass(frozen=True)
class TorqueLimits:
    """Of the commands, (n,) each: N·m, N·m/s; positions (n, 2) rad and speeds (n,) rad/s of the predicted motion."""

    torque: Array
    torque_rate: Array
    position: Array
    speed: Array

    def kept_by(self, torque: Array, period: float) -> NDArray[np.bool_]:
        """(n,) whether each joint's torque history (samples × n) keeps the torque and rate limits."""
        rate = np.abs(np.diff(torque, axis=0)).max(axis=0) / period
        most = (1.0 - FEEDBACK_SHARE) * self.torque
        return np.asarray((np.abs(torque).max(axis=0) <= most) & (rate <= self.torque_rate * (1.0 + 1e-9)))


def constrained(
    wanted: Array, q: Array, dq: Array, arm: LinearArm, loop: FeedbackLoop, limits: TorqueLimits, name: str = "motion"
) -> Array:
    """Torques (samples × n) within the limits; ``wanted`` itself where it keeps them.

    ``q``, ``dq``: the reference. ``arm``: linearised anywhere along the motion; its mean inertia predicts what a lack
    of torque does. Raises InputError, naming joint and time, when no torque keeps the motion within its limits.
    """
    kept = limits.kept_by(wanted, loop.period)
    if kept.all():
        return wanted
    result = wanted.copy()
    inertia = np.mean(np.diagonal(arm.inertia, axis1=1, axis2=2), axis=0)
    for joint in np.flatnonzero(~kept):
        result[:, joint] = _one_joint(
            wanted[:, joint], q[:, joint], dq[:, joint], float(inertia[joint]), loop, limits, int(joint), name
        )
    return result


def _one_joint(
    wanted: Array, q: Array, dq: Array, inertia: float, loop: FeedbackLoop, limits: TorqueLimits, joint: int, name: str
) -> Array:
    """Unknowns: torque u, angle error e, speed error v, and the size s of v, a sample each."""
    h, count = loop.period, len(wanted)
    stiffness, damping = float(loop.stiffness[joint]), float(loop.damping[joint])
    most, rate = (1.0 - FEEDBACK_SHARE) * float(limits.torque[joint]), float(limits.torque_rate[joint])
    if abs(wanted[0]) > most or abs(wanted[-1]) > most:
        raise InputError(
            name,
            f"joint number {joint + 1} needs {wanted[0]:.4g} and {wanted[-1]:.4g} N·m at its ends, at rest, and may "
            f"use {most:.4g} N·m",
            "choose another pose or a lighter load",
        )
    one, none = eye_array(count, format="csc"), csc_array((count, count))
    back = eye_array(count, k=-1, format="csc")
    # v[k] = v[k−1] + h/M·(u − wanted − K·e[k−1] − D·v[k−1]);  e[k] = e[k−1] + h·v[k];  −s ≤ v ≤ s
    speed = [-h / inertia * one, (h * stiffness / inertia) * back, one - (1.0 - h * damping / inertia) * back, none]
    angle = [none, one - back, -h * one, none]
    step = [one - back, none, none, none]
    rows = block_array([speed, angle, step, [none, none, one, -one], [none, none, one, one]], format="csc")
    driven, zero, free = -h / inertia * wanted, np.zeros(count), np.full(count, np.inf)
    change = np.full(count, rate * h)
    change[0] = np.inf
    low, high = limits.position[joint]
    top = float(limits.speed[joint])
    lower = np.concatenate([np.full(count, -most), low - q, -top - dq, zero])
    upper = np.concatenate([np.full(count, most), high - q, top - dq, free])
    # What holds the arm before the motion is not ours to choose.
    lower[0] = upper[0] = wanted[0]
    found = milp(
        np.concatenate([np.zeros(3 * count), np.ones(count)]),
        constraints=LinearConstraint(
            rows,
            np.concatenate([driven, zero, -change, -free, zero]),
            np.concatenate([driven, zero, change, zero, free]),
        ),
        bounds=Bounds(lower, upper),
    )
    if not found.success:
        worst = int(np.argmax(np.abs(wanted)))
        raise InputError(
            name,
            f"joint number {joint + 1} needs {wanted[worst]:.4g} N·m at {worst * h:.3f} s and may use {most:.4g} N·m: "
            "no torque within the limits keeps the motion inside its positions and speeds",
            "slow the motion down",
        )
    return np.asarray(found.x[:count])
