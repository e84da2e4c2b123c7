"""Joints at rest: their torque says little, for friction holds them with whatever torque it takes, up to its level.

A joint that creeps or stands has friction anywhere between plus and minus the breakaway level, by how it came there; a
friction that is a function of velocity is wrong by up to that level, and it is wrong for as long as the joint stands.
So a joint's equations count while it moves. Leaving them out is a weight in time, the same for torque and regressor,
and the equation stays true.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, uniform_filter1d

from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_REST = 0.08
"""Share of its rms speed below which a joint counts as at rest."""
_LEAST_MOVING = 0.2
"""Share of the time that a joint must move for its rests to be left out: what hardly moves is known at rest or not."""
_COARSE = 50.0
"""Hz to which angles are thinned for a joint's typical speed: noise of the encoder is then no motion."""


def rms_speeds(trajectories: Sequence[Trajectory]) -> Array:
    """(n,) rad/s (m/s): each joint's, over all recordings."""
    square, duration = 0.0, 0.0
    for trajectory in trajectories:
        way, steps = _coarse(trajectory)
        square = square + np.nansum(way**2 / steps, axis=0)
        duration += float(steps.sum())
    return np.asarray(np.sqrt(np.asarray(square) / duration))


def rest_speeds(trajectories: Sequence[Trajectory]) -> Array:
    """(n,) rad/s (m/s): slower is at rest. Zero, so that all counts, for a joint that hardly ever moves."""
    limit = _REST * rms_speeds(trajectories)
    moving, duration = np.zeros(len(limit)), 0.0
    for trajectory in trajectories:
        way, steps = _coarse(trajectory)
        moving += np.sum((np.abs(way) > limit * steps) * steps, axis=0)
        duration += float(steps.sum())
    return np.where(moving > _LEAST_MOVING * duration, limit, 0.0)


def motion_weight(dq: Array, limit: Array, length: int) -> Array:
    """(n, samples): one where a joint moves, zero where it rests, with slopes ``length`` samples long between.

    ``dq`` (samples, n) smoothed velocities, ``limit`` (n,) of `rest_speeds`. Short runs of noise are averaged out.
    """
    mean = uniform_filter1d(dq.T, max(1, length), axis=1, mode="nearest")
    return weight_without(np.abs(mean) < limit[:, None], length)


def weight_without(left_out: NDArray[np.bool_], length: int) -> Array:
    """(n, samples): zero where ``left_out`` (n, samples), one elsewhere, with slopes ``length`` samples long."""
    if not left_out.any():
        return np.ones(left_out.shape)
    around = maximum_filter1d(left_out.astype(np.uint8), 2 * length + 1, axis=1, mode="nearest")
    # Two running means make a slope without corners, inside what was set aside for it.
    weight = 1.0 - around.astype(float)
    for _ in range(2):
        weight = uniform_filter1d(weight, max(1, length), axis=1, mode="nearest")
    return np.asarray(np.clip(weight, 0.0, 1.0))


def _coarse(trajectory: Trajectory) -> tuple[Array, Array]:
    """Ways (steps, n) between thinned samples, and the times (steps, 1) they took."""
    thinned = slice(None, None, max(1, round(trajectory.rate / _COARSE)))
    return np.diff(trajectory.q[thinned], axis=0), np.diff(trajectory.t[thinned])[:, None]
