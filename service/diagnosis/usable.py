"""What of a recording a diagnosis may look at: not the torques of a sensor at the end of its range, or of none.

An effect there would be the sensor's, and be named as the arm's.
"""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from config import InputError
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

_MOVED = 0.01
"""rad (m): a joint that went so far needed a torque."""
_LEAST = 1.0
"""s without a torque that is cut off."""


def only_usable(body: RigidBody, trajectory: Trajectory) -> Trajectory:
    """The recording with the samples missing in which a torque is cut off.

    Raises InputError where a joint moves whose torque never changes, and where not a second is left in one piece.
    """
    if trajectory.unusable is None:
        return trajectory
    dead = trajectory.unusable.all(axis=0)
    way = np.fmax.reduce(trajectory.q, axis=0) - np.fmin.reduce(trajectory.q, axis=0)
    if (dead & (way > _MOVED)).any():
        names = ", ".join(body.joints[joint] for joint in np.flatnonzero(dead & (way > _MOVED)))
        problem = f"the torque of {names} never changes, although the joint moves"
        raise InputError(trajectory.name, problem, "check the sensor, or leave this recording out")
    cut_off = trajectory.unusable & ~dead
    whole = replace(trajectory, tau=np.where(cut_off, np.nan, trajectory.tau))
    longest = max((len(piece) for piece in whole.segments(trajectory.samples, 0)), default=0)
    if cut_off.any() and longest < _LEAST * trajectory.rate:
        names = ", ".join(body.joints[joint] for joint in np.flatnonzero(cut_off.any(axis=0)))
        problem = f"the torque of {names} is cut off at the end of its range so often that no second is left between"
        raise InputError(trajectory.name, problem, "choose a larger range, or a gentler motion")
    return whole
