"""Where the tool is at given joint angles, and the angles that bring it somewhere."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.optimize import least_squares

from config import InputError
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]
REACHED_M = 1e-6
NEAR = 1e-3
"""m/rad: how much the angles' own distance from ``near`` weighs beside the tool's from the point."""


class ToolPoint:
    """Origin of one frame of an arm, in the base's frame. Raises InputError when the arm has no such frame."""

    def __init__(self, body: RigidBody, frame: str) -> None:
        if not body.model.existFrame(frame):
            raise InputError(frame, "is no frame of the arm", "name a link of its URDF")
        self._body, self._data = body, body.model.createData()
        self._frame = body.model.getFrameId(frame)

    def at(self, q: Array) -> Array:
        """(3,) m at joint angles (n,) rad."""
        pin.framesForwardKinematics(self._body.model, self._data, self._body.configuration(q))
        return np.array(self._data.oMf[self._frame].translation)

    def angles(self, point: Array, near: Array, limits: Array) -> Array:
        """(n,) rad within ``limits`` (n, 2), close to ``near``, that bring the tool to ``point`` (3,) m.

        Raises InputError when no angles do.
        """
        found = np.clip(near, limits[:, 0], limits[:, 1])
        # First the angles near the given ones, then, from there, the point itself.
        for weight in (NEAR, 0.0):

            def off(q: Array, weight: float = weight) -> Array:
                return np.concatenate([self.at(q) - point, weight * (q - near)])

            found = least_squares(
                off,
                found,
                bounds=(limits[:, 0], limits[:, 1]),
                xtol=1e-12,
                ftol=1e-12,
                gtol=1e-12,
            ).x
        missed = float(np.linalg.norm(self.at(found) - point))
        if missed > REACHED_M:
            raise InputError(
                "point_m",
                f"the tool comes within {missed:.3g} m of it at best, near the given start and end",
                "choose a point within reach",
            )
        return np.asarray(found)
