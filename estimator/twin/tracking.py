"""Who moved the arm: the controller under which a recording is replayed.

Every controller here is linear about its references, tau = K·(q_ref − q) + D·(dq_ref − dq) + tau_ref. With a servo in
the drive the references are the recorded commands. With torques commanded by a host, or with no command recorded at
all, the references are the recorded motion and the torque that went with it: any controller that is linear reacts to a
deviation from the recorded motion just so, and when the twin equals the arm there is no deviation. Recorded torques
alone would not do: without feedback a double integrator runs away from the smallest error, and the distance would
measure the recording's length, not the model.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

DECLARED_BANDWIDTH_HZ = 1.0
"""Of the feedback that keeps a torque replay near the recording when nothing is known of the controller."""
POSES = 50
EXPLAINED = 0.95
"""Share of the torque's variance that a servo law must explain to be taken for the recorded controller."""


@dataclass(frozen=True)
class Tracking:
    """References (samples, n) at the times of the trajectory's samples, gains (n,); rad, rad/s, N·m."""

    kind: str
    """What it is, in words, for the report."""
    q: Array
    dq: Array
    tau: Array
    stiffness: Array
    damping: Array


def drive_servo(
    trajectory: Trajectory, q_d: Array, dq_d: Array, tau_ff: Array | None, stiffness: Array, damping: Array, late: float
) -> Tracking:
    """A servo in the drive (cyclic synchronous position): commands (samples, n) act ``late`` s after they are recorded.

    With Étude's own loop that is two cycles: a command of cycle k goes out after its feedback, is taken over at the
    SYNC of k + 1, and is reached, interpolated, at that of k + 2.
    """
    feedforward = np.zeros_like(q_d) if tau_ff is None else tau_ff
    q, dq, tau = (_late(trajectory.t, channel, late) for channel in (q_d, dq_d, feedforward))
    return Tracking("the drives' servos with the recorded commands", q, dq, tau, stiffness, damping)


def host_controller(trajectory: Trajectory, dq: Array, stiffness: Array, damping: Array) -> Tracking:
    """A controller of known gains in the host (cyclic synchronous torque): the recorded torque, and its reaction."""
    kind = "the recorded torques with the host controller's gains"
    return Tracking(kind, trajectory.q, dq, trajectory.tau, stiffness, damping)


def estimated_servo(trajectory: Trajectory, dq: Array) -> Tracking | None:
    """Of a foreign recording with commanded positions: gains by least squares of the torque on the tracking error.

    None where that law does not explain the torque of every joint, or is none of a servo.
    """
    if trajectory.q_desired is None:
        return None
    q_d = trajectory.q_desired
    dq_d = np.gradient(q_d, trajectory.t, axis=0)
    whole = np.isfinite(q_d - trajectory.q + trajectory.tau + dq).all(axis=1)
    gains = []
    for joint in range(q_d.shape[1]):
        error = np.column_stack([(q_d - trajectory.q)[whole, joint], (dq_d - dq)[whole, joint], np.ones(whole.sum())])
        tau = trajectory.tau[whole, joint]
        gain = np.linalg.lstsq(error, tau, rcond=None)[0]
        missed = float(np.var(tau - error @ gain))
        if gain[0] <= 0.0 or gain[1] < 0.0 or missed > (1.0 - EXPLAINED) * float(np.var(tau)):
            return None
        gains.append(gain)
    stiffness, damping, offset = np.array(gains).T
    kind = "servos whose gains were estimated from the recorded commands"
    return Tracking(kind, q_d, dq_d, np.tile(offset, (len(q_d), 1)), stiffness, damping)


def torque_replay(
    body: RigidBody, trajectory: Trajectory, dq: Array, bandwidth_hz: float = DECLARED_BANDWIDTH_HZ
) -> Tracking:
    """The recorded torques, with feedback of a declared bandwidth, critically damped at each joint's mean inertia."""
    w = 2.0 * np.pi * bandwidth_hz
    inertia = mean_inertia(body, trajectory.q)
    kind = f"the recorded torques with a feedback of {bandwidth_hz:g} Hz to the recorded motion"
    return Tracking(kind, trajectory.q, dq, trajectory.tau, inertia * w**2, 2.0 * inertia * w)


def mean_inertia(body: RigidBody, q: Array) -> Array:
    """(n,) kg·m² about each joint, the mean over poses spread along q (samples, n)."""
    whole = q[np.isfinite(q).all(axis=1)]
    poses = whole[np.linspace(0, len(whole) - 1, POSES).astype(int)]
    data = body.model.createData()
    return np.asarray(
        np.mean([np.diag(pin.crba(body.model, data, body.configuration(pose))).copy() for pose in poses], axis=0)
    )


def velocities(trajectory: Trajectory) -> Array:
    """(samples, n) rad/s as measured, else the slope of the angles; NaN in gaps."""
    if trajectory.dq is not None:
        return trajectory.dq
    result = np.full(trajectory.q.shape, np.nan)
    for rows in trajectory.segments(trajectory.samples, 0):
        result[rows] = np.gradient(trajectory.q[rows], trajectory.t[rows], axis=0)
    return result


def _late(t: Array, channel: Array, by: float) -> Array:
    return np.array([np.interp(t - by, t, column) for column in channel.T]).T
