"""Within which limits an arm may be moved to decide between causes: its installation's, else what its URDF and its
recordings tell."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.excitation import MotionLimits
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK
from estimator.trajectory import Trajectory
from service.identification.designed_motion import limits_of
from service.identification.read import ReadRecordings

Array = NDArray[np.float64]

_ROOM = 0.05
"""rad (m) kept off the ends of a URDF's range, half of what a joint must have to be moved."""
_STEP_S = 0.1
"""Over which recorded speeds and accelerations are taken."""


def limits_and_home(read: ReadRecordings) -> tuple[MotionLimits | None, Array]:
    """The installation's limits and home; of a URDF alone its own, and the middle of what was recorded."""
    installation = read.arm.installation
    if installation is not None and read.body.joints == installation.joint_names:
        return limits_of(installation, read.body), np.array(installation.arm.home_rad)
    return limits_of_urdf(read.body, read.trajectories)


def limits_of_urdf(body: RigidBody, trajectories: Sequence[Trajectory]) -> tuple[MotionLimits | None, Array]:
    """A URDF has no accelerations, and continuous joints no range: there the recordings say what the arm may do."""
    model = body.model
    q = np.concatenate([trajectory.q for trajectory in trajectories])
    seen_low, seen_high = np.nanmin(q, axis=0), np.nanmax(q, axis=0)
    low, high = seen_low.copy(), seen_high.copy()
    for joint in range(body.n):
        index = model.joints[joint + 1].idx_q
        if model.joints[joint + 1].nq == 1 and model.upperPositionLimit[index] > model.lowerPositionLimit[index]:
            low[joint] = model.lowerPositionLimit[index] + _ROOM
            high[joint] = model.upperPositionLimit[index] - _ROOM
    speed, bend = _fastest(trajectories)
    given = np.asarray(model.velocityLimit, dtype=float)
    velocity = np.where((given > 0.0) & np.isfinite(given), given, speed)
    torque = np.asarray(model.effortLimit, dtype=float)
    parameters = body.prior()
    held = bool(np.all(torque > 0.0) and np.all(np.isfinite(torque)) and np.any(parameters[::10] > 0.0))
    home = np.nanmedian(q, axis=0)
    if np.any(high - low < 2.0 * _ROOM) or np.any(velocity <= 0.0) or np.any(bend <= 0.0):
        return None, home
    limits = MotionLimits(low, high, velocity, bend, 0.9 * torque if held else None, parameters if held else None)
    return limits, np.clip(home, low, high)


def _fastest(trajectories: Sequence[Trajectory]) -> tuple[Array, Array]:
    """(n,) highest speed and acceleration of recorded motions, over a tenth of a second."""
    speeds, bends = [], []
    pieces = [(trajectory, piece) for trajectory in trajectories for piece in trajectory.segments(CHUNK, 0)]
    for trajectory, piece in pieces:
        t = np.arange(trajectory.t[piece[0]], trajectory.t[piece[-1]], _STEP_S)
        if len(t) < 4:
            continue
        q = np.stack([np.interp(t, trajectory.t[piece], column) for column in trajectory.q[piece].T], axis=1)
        dq = np.gradient(q, t, axis=0)
        speeds.append(np.abs(dq).max(axis=0))
        bends.append(np.abs(np.gradient(dq, t, axis=0)).max(axis=0))
    if not speeds:
        nothing = np.zeros(trajectories[0].q.shape[1])
        return nothing, nothing
    return np.max(speeds, axis=0), np.max(bends, axis=0)
