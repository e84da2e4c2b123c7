"""The sensor's offset, read while it carries nothing, or nothing but a known hand."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.loads.frame_motion import frame_motion
from estimator.loads.parameters import RigidLoad
from estimator.loads.poses import resting_poses
from estimator.loads.recording import LoadRecording
from estimator.loads.wrench_regressor import wrench_of_load
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_REMEDY = "record a second at rest, without the load"
_FINEST = 1e-6
"""N, N·m: a mean is never surer than that."""


@dataclass(frozen=True)
class Tare:
    """A reading of the sensor without the load, its hand's weight taken off: the offsets (6,) N, N·m at session time
    ``t`` s, with standard errors (6,)."""

    t: float
    offset: Array
    standard_error: Array


def tare(body: RigidBody, frame: str, recording: LoadRecording, hand: RigidLoad | None = None) -> Tare:
    """From a recording in which the arm rests. Raises InputError when it does not."""
    name = recording.motion.name
    try:
        poses = resting_poses([recording])
    except InputError:
        raise InputError(
            name, "the arm does not rest in this tare", "record a second at rest, without the load"
        ) from None
    if len(poses.q) > 1 and np.ptp(poses.q, axis=0).max() > 0.01 and hand is None:
        raise InputError(name, "the arm moves between poses in this tare", "record a second at rest, without the load")
    still = np.zeros_like(poses.q)
    weight = np.zeros_like(poses.wrench)
    if hand is not None:
        known = np.where(np.isfinite(hand.parameters), hand.parameters, 0.0)
        weight[:] = wrench_of_load(known, frame_motion(body, frame, poses.q, still, still))
    offsets = poses.wrench - weight
    error = np.sqrt((poses.error**2).mean(axis=0) / len(offsets))
    return Tare(float(poses.t.mean()), offsets.mean(axis=0), np.maximum(error, _FINEST))
