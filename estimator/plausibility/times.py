"""Whether a recording's times can be seconds: samples of a moving arm are neither rarer nor closer than some bounds."""

from __future__ import annotations

from config import InputError
from estimator.trajectory import Trajectory

_FAR_APART = 0.5
"""s between samples: times in milliseconds or nanoseconds read like that."""
_FASTEST = 25e3
"""Hz: no servo's cycle is as fast; times in minutes read like that, or in seconds that were divided once too often."""


def check_times(trajectory: Trajectory) -> None:
    """Raises InputError where the samples are too far apart, or too close, for a motion told in seconds."""
    apart = 1.0 / trajectory.rate
    if apart > _FAR_APART:
        problem = f"samples are {apart:.3g} s apart, too far for any motion"
    elif trajectory.rate > _FASTEST:
        problem = f"samples are {1e6 * apart:.3g} µs apart, closer than those of any drive"
    else:
        return
    raise InputError(trajectory.name, problem, "give times in seconds")
