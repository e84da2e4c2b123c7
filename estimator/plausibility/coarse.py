"""Fast recordings at the pace that is enough to tell what they are: the filters that look at them are seconds long,
and take the square of the rate to design."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_ENOUGH = 250.0
"""Hz: ten times the widest band that a snapshot is flat to."""
_GAP = 1.5
"""Times its usual length: a block of samples with a gap in it."""


def coarse(trajectory: Trajectory) -> Trajectory:
    """The recording by means of successive samples, no slower than `_ENOUGH`; itself where it is not twice as fast.

    A block that lacks a sample is NaN; ``unusable`` are those in which any torque is.
    """
    size = int(trajectory.rate / _ENOUGH)
    if size < 2 or trajectory.samples < 20 * size:
        return trajectory
    count = trajectory.samples // size

    def blocks(values: Array) -> Array:
        return np.asarray(values[: count * size]).reshape(count, size, *values.shape[1:])

    def means(values: Array) -> Array:
        return np.asarray(np.mean(blocks(values), axis=1))

    times = blocks(trajectory.t)
    q = means(trajectory.q)
    q[times[:, -1] - times[:, 0] > _GAP * size / trajectory.rate] = np.nan
    return replace(
        trajectory,
        t=np.mean(times, axis=1),
        q=q,
        tau=means(trajectory.tau),
        dq=None if trajectory.dq is None else means(trajectory.dq),
        ddq=None,
        q_desired=None,
        temperature=None if trajectory.temperature is None else means(trajectory.temperature),
        unusable=None if trajectory.unusable is None else means(trajectory.unusable.astype(float)) > 0.0,
    )
