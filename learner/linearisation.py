"""The arm linearised along a motion: M·δddq + D·δdq + G·δq = δu."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm

from learner.inverse_model import InverseModel

Array = NDArray[np.float64]
ANGLE_STEP, SPEED_STEP = 1e-4, 0.05
"""rad, rad/s of the central differences. The speed's is wide: friction's step at rest counts by its mean slope."""


@dataclass(frozen=True)
class LinearArm:
    """``inertia`` M [kg·m²], ``damping`` D [N·m·s/rad], ``stiffness`` G [N·m/rad], (points, n, n) each."""

    inertia: Array
    damping: Array
    stiffness: Array

    @property
    def n(self) -> int:
        return int(self.inertia.shape[-1])

    def heavier(self, share: float) -> LinearArm:
        """The arm whose inertia is larger by that share."""
        return LinearArm(self.inertia * (1.0 + share), self.damping, self.stiffness)

    def sampled(self, period: float) -> tuple[Array, Array]:
        """(A, B) of y[k] = A·y[k−1] + B·u[k] with y = (δq, δdq): u[k] is held over the period that ends at sample k.

        A (points, 2n, 2n), B (points, 2n, n). The torques are renumbered as in Eq. 6.18: no delay of one sample.
        """
        points, n = len(self.inertia), self.n
        flow = np.zeros((points, 3 * n, 3 * n))
        inverse = np.linalg.inv(self.inertia)
        flow[:, :n, n : 2 * n] = np.eye(n)
        flow[:, n : 2 * n, :n] = -inverse @ self.stiffness
        flow[:, n : 2 * n, n : 2 * n] = -inverse @ self.damping
        flow[:, n : 2 * n, 2 * n :] = inverse
        step = np.asarray(expm(flow * period), dtype=float)
        return step[:, : 2 * n, : 2 * n], step[:, : 2 * n, 2 * n :]


def linearise(model: InverseModel, q: Array, dq: Array, ddq: Array) -> LinearArm:
    """The model's derivatives at points of a motion (points × n each), by central differences."""
    points, n = q.shape
    still = np.zeros_like(q)
    # All displaced motions in one call: the model's cost a call is much above its cost a sample.
    moves: list[tuple[Array, Array, Array]] = []
    for joint in range(n):
        unit = np.zeros_like(q)
        unit[:, joint] = 1.0
        for sign in (1.0, -1.0):
            moves.append((still, still, sign * unit))
            moves.append((still, sign * SPEED_STEP * unit, still))
            moves.append((sign * ANGLE_STEP * unit, still, still))
    a, b, c = (np.concatenate([m[k] for m in moves]) for k in range(3))
    times = len(moves)
    tau = model.torque(np.tile(q, (times, 1)) + a, np.tile(dq, (times, 1)) + b, np.tile(ddq, (times, 1)) + c)
    parts = tau.reshape(n, 2, 3, points, n)
    slopes = (parts[:, 0] - parts[:, 1]) / (2.0 * np.array([1.0, SPEED_STEP, ANGLE_STEP])[None, :, None, None])
    inertia, damping, stiffness = (np.ascontiguousarray(slopes[:, k].transpose(1, 2, 0)) for k in range(3))
    return LinearArm(inertia, damping, stiffness)


def spread(samples: int, points: int) -> NDArray[np.intp]:
    """Indices of about that many instants, spread evenly over the samples."""
    return np.unique(np.linspace(0, samples - 1, min(points, samples)).astype(np.intp))
