"""What torques are recorded with beside the angles: each joint's delay, and a filter that all go through."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.effects import Lag

Array = NDArray[np.float64]

_SAME = 0.05
"""Of a delay, within which another makes hardly other laws."""


@dataclass(frozen=True)
class Lateness:
    """Of one arm's recordings."""

    delay: Array
    """(n,) s by which torques answer late to the motion."""
    lag: Lag | None

    def differs_from(self, other: Lateness | None) -> bool:
        """Whether laws of torques are others with it; beside None, whether it is any."""
        told = other or Lateness(np.zeros_like(self.delay), None)
        if (self.lag is None) != (told.lag is None):
            return True
        ours, theirs = (np.array([*x.delay, *(x.lag or ())]) for x in (self, told))
        return bool(np.any(np.abs(ours - theirs) > _SAME * np.maximum(np.abs(ours), np.abs(theirs))))
