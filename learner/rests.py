"""Where a motion rests, and where its joints are so slow that friction may hold them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from learner.trial import Reference, Trial

Array = NDArray[np.float64]
SLOW_SHARE = 0.1
"""Of a joint's fastest speed, below which it may stick."""
RAMP_S = 0.05
"""Within which a trial tells less and less of what the arm needs at rest."""


def speed_weight(reference: Reference) -> Array:
    """(samples, n): one where a joint is on its way, falling to zero where it comes to rest and leaves it.

    There a joint with friction sticks and lets go, at another moment for the slightest change of the command: what
    differs there says nothing of another arm. A joint that is to stand still throughout counts throughout.
    """
    speed = np.abs(reference.dq)
    fastest = speed.max(axis=0)
    return np.where(fastest > 0.0, np.minimum(speed / np.maximum(SLOW_SHARE * fastest, 1e-12), 1.0), 1.0)


def slow_share(trials: Sequence[Trial], reference: Reference) -> Array:
    """(n,) of the power of the trials' velocity errors, what lies where a joint is slow. 0 where there is no error."""
    power = np.sum([(trial.dq - reference.dq)[reference.moving] ** 2 for trial in trials], axis=0)
    slow = speed_weight(reference)[reference.moving] < 1.0
    whole = power.sum(axis=0)
    return np.asarray(np.sum(slow * power, axis=0) / np.where(whole > 0.0, whole, 1.0))


def moving_weight(reference: Reference) -> Array:
    """(samples, 1): one where the motion is, falling to zero over `RAMP_S` of the rests around it."""
    start, stop, _ = reference.moving.indices(reference.samples)
    k = np.arange(reference.samples)
    away = np.maximum(np.maximum(start - k, k - (stop - 1)), 0) * reference.period / RAMP_S
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.minimum(away, 1.0)))[:, None]
