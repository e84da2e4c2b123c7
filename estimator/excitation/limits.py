"""Limits of a designed motion, as how far it goes beyond each; with exact slopes."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from estimator.excitation.slopes import slopes
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_SUNK_M = 0.05
"""Below the floor by this much is as bad as twice a limit."""


@dataclass(frozen=True)
class MotionLimits:
    """(n,) each; rad, rad/s, rad/s², N·m (m, …, N where a joint slides).

    ``torque`` is held by the model ``parameters`` (10·n,); both or neither. ``floor`` m: all joints' origins and the
    points ``tips`` (k, 3) of the last link stay above that height in the base's frame. ``stand`` (n,) is the pose that
    a design starts from and is drawn back to; the middle of the joints' ranges without one.
    """

    lower: Array
    upper: Array
    velocity: Array
    acceleration: Array
    torque: Array | None = None
    parameters: Array | None = None
    floor: float | None = None
    tips: tuple[tuple[float, float, float], ...] = ()
    stand: Array | None = None

    @property
    def centre(self) -> Array:
        """(n,) the pose to stand in."""
        return (self.upper + self.lower) / 2.0 if self.stand is None else self.stand

    def worst(self, body: RigidBody, q: Array, dq: Array, ddq: Array) -> float:
        """The largest use of any limit, one being all of it; of the joints' ranges about their middles."""
        half = (self.upper - self.lower) / 2.0
        uses = [
            np.abs(q - (self.upper + self.lower) / 2.0) / half,
            np.abs(dq) / self.velocity,
            np.abs(ddq) / self.acceleration,
        ]
        if self.torque is not None and self.parameters is not None:
            uses.append(np.abs(inverse_dynamics(body, self.parameters, q, dq, ddq)) / self.torque)
        worst = max(float(use.max()) for use in uses)
        sunk = self.below_floor(body, q)
        return max(worst, 1.0 + sunk / _SUNK_M) if sunk > 0.0 else worst

    def below_floor(self, body: RigidBody, q: Array) -> float:
        """m that the lowest point sinks below the floor in poses (samples, n); 0 when it does not, or there is none."""
        if self.floor is None:
            return 0.0
        return max(0.0, self.floor - min(float(_points(body, pose, self.tips)[0].min()) for pose in q))

    def penalty(self, body: RigidBody, q: Array, dq: Array, ddq: Array) -> tuple[float, tuple[Array, ...]]:
        """Mean square of what goes beyond the limits, each in its own units, and its derivatives by q, dq, ddq."""
        samples = len(q)
        half = (self.upper - self.lower) / 2.0
        total = 0.0
        by: list[Array] = []
        for value, middle, limit in (
            (q, (self.upper + self.lower) / 2.0, half),
            (dq, 0.0, self.velocity),
            (ddq, 0.0, self.acceleration),
        ):
            use = (value - middle) / limit
            beyond = np.sign(use) * np.maximum(np.abs(use) - 1.0, 0.0)
            total += float(np.sum(beyond**2)) / samples
            by.append(2.0 * beyond / limit / samples)
        if self.torque is not None and self.parameters is not None:
            use = inverse_dynamics(body, self.parameters, q, dq, ddq) / self.torque
            beyond = np.sign(use) * np.maximum(np.abs(use) - 1.0, 0.0)
            if beyond.any():
                total += float(np.sum(beyond**2)) / samples
                weights = (2.0 * beyond / self.torque / samples)[:, :, None] * self.parameters
                by = [a + b for a, b in zip(by, slopes(body, weights, q, dq, ddq), strict=True)]
        if self.floor is not None:
            value_of_floor, slope = _floor_penalty(body, q, self.tips, self.floor)
            total, by[0] = total + value_of_floor, by[0] + slope
        return total, tuple(by)


def _points(body: RigidBody, q: Array, tips: tuple[tuple[float, float, float], ...]) -> tuple[Array, Array]:
    """Heights (points,) of the joints' origins and the tips at one pose, and their derivatives (points, n). The first
    joint's origin is left out: no motion moves it."""
    data = body.model.createData()
    pin.computeJointJacobians(body.model, data, body.configuration(q))
    last = body.model.njoints - 1
    places = [(k, np.zeros(3)) for k in range(2, body.model.njoints)] + [(last, np.array(tip)) for tip in tips]
    heights, by_q = np.empty(len(places)), np.empty((len(places), body.n))
    for row, (joint, offset) in enumerate(places):
        frame = data.oMi[joint]
        jacobian = pin.getJointJacobian(body.model, data, joint, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        arm = frame.rotation @ offset
        heights[row] = frame.translation[2] + arm[2]
        # Velocity of the point: v + ω × arm, its third component.
        by_q[row] = jacobian[2] + jacobian[3] * arm[1] - jacobian[4] * arm[0]
    return heights, by_q


def _floor_penalty(
    body: RigidBody, q: Array, tips: tuple[tuple[float, float, float], ...], floor: float
) -> tuple[float, Array]:
    total, slope = 0.0, np.zeros(q.shape)
    for k, pose in enumerate(q):
        heights, by_q = _points(body, pose, tips)
        beyond = np.maximum(floor - heights, 0.0) / _SUNK_M
        total += float(beyond @ beyond) / len(q)
        slope[k] = -2.0 * beyond @ by_q / (_SUNK_M * len(q))
    return total, slope
