"""What is recorded late: each joint's torque beside the angles, by a filter that all go through, or an angle."""

from __future__ import annotations

from collections.abc import Iterable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]
Lag = tuple[float, float]
"""Of a low-pass filter 1/(1 + a·s + b·s²) of torques: a in s, b in s²."""

_SAME = 0.05
"""Of a delay, within which another makes hardly other laws."""


@dataclass(frozen=True)
class Lateness:
    """Of one arm's recordings."""

    delay: Array
    """(n,) s by which torques answer late to the motion."""
    angles: Array
    """(n,) s by which single joints' angles are late; what goes with them answers early by as much."""
    lag: Lag | None = None
    """What all torques go through besides."""

    @classmethod
    def none(cls, joints: int) -> Lateness:
        """Of recordings in which nothing is late."""
        return cls(np.zeros(joints), np.zeros(joints))

    @classmethod
    def together(cls, joints: int, parts: Iterable[Lateness]) -> Lateness:
        """Of all that several causes make late."""
        result = cls.none(joints)
        for part in parts:
            result = cls(result.delay + part.delay, result.angles + part.angles, result.lag or part.lag)
        return result

    @property
    def is_any(self) -> bool:
        """Whether anything is late."""
        return bool(self.delay.any() or self.angles.any() or self.lag)

    def differs_from(self, other: Lateness | None) -> bool:
        """Whether laws of torques are others with it; beside None, whether it is any."""
        told = other or Lateness.none(len(self.delay))
        if (self.lag is None) != (told.lag is None):
            return True
        ours, theirs = (np.array([*x.delay, *x.angles, *(x.lag or ())]) for x in (self, told))
        return bool(np.any(np.abs(ours - theirs) > _SAME * np.maximum(np.abs(ours), np.abs(theirs))))
