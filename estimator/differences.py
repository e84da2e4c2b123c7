"""Speeds that are no measurement: differences of the angles that are recorded beside them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_SAME = 1e-4
"""Of a joint's rms speed: as numbers are the same that were written down with a few digits."""


def with_speeds_of_their_own(trajectories: Sequence[Trajectory]) -> list[Trajectory]:
    """The recordings, without speeds where all of them hold differences of their angles: what these show beside the
    angles is how they were computed, and would be taken for a sensor that is late or has another gain."""
    if any(trajectory.dq is None or not differenced(trajectory) for trajectory in trajectories):
        return list(trajectories)
    return [replace(trajectory, dq=None) for trajectory in trajectories]


def differenced(trajectory: Trajectory) -> bool:
    """Whether the recorded speeds are the angles' differences, forward, backward or central."""
    dq = trajectory.dq
    if dq is None or trajectory.samples < 3:
        return False
    t, q, speed = trajectory.t[:, None], trajectory.q, dq[1:-1]
    step = np.diff(q, axis=0) / np.diff(t, axis=0)
    differences = (
        step[:-1],
        step[1:],
        (q[2:] - q[:-2]) / (t[2:] - t[:-2]),
        np.gradient(q, trajectory.t, axis=0)[1:-1],
    )
    size = np.sqrt(np.nansum(speed**2, axis=0))
    return any(bool(np.all(np.sqrt(np.nansum((speed - own) ** 2, axis=0)) <= _SAME * size)) for own in differences)
