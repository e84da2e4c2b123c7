"""Forces from outside: a wall in the way of the tool, a push at a time."""

from __future__ import annotations

from typing import Self

import numpy as np
from pydantic import model_validator

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import NotNegative, Vector3


class Wall(Section):
    """A compliant plane: a point of a link pressed behind it is pushed back by k·depth + d·rate along the normal."""

    link: Name
    at_m: Vector3 = (0.0, 0.0, 0.0)
    """The point that touches, in the link's frame."""
    point_m: Vector3
    """A point of the plane, in the base frame."""
    normal: Vector3
    """Out of the wall, in the base frame."""
    stiffness_n_m: Positive
    damping_ns_m: NotNegative = 0.0

    @model_validator(mode="after")
    def _direction(self) -> Self:
        if not any(self.normal):
            raise ValueError("normal is zero; give the direction out of the wall")
        return self

    def force(self, position: np.ndarray, velocity: np.ndarray) -> np.ndarray | None:
        """Force on the link, N in the base frame, at the touching point; None off the wall. Never pulls."""
        normal = np.asarray(self.normal) / np.linalg.norm(self.normal)
        depth = float(normal @ (np.asarray(self.point_m) - position))
        if depth <= 0.0:
            return None
        push = self.stiffness_n_m * depth - self.damping_ns_m * float(normal @ velocity)
        return np.asarray(normal * max(0.0, push))


class Push(Section):
    """A force on a point of a link, constant in the base frame, from ``from_s`` until ``until_s``."""

    link: Name
    at_m: Vector3 = (0.0, 0.0, 0.0)
    force_n: Vector3
    from_s: NotNegative
    until_s: Positive

    @model_validator(mode="after")
    def _interval(self) -> Self:
        if self.until_s <= self.from_s:
            raise ValueError("until_s is not later than from_s")
        return self
