"""What learning needs of a model of the arm: the torque of a motion, R̂⁻¹ (Eq. 6.3)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Protocol

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


class InverseModel(Protocol):
    """Inverse dynamics of an arm: rigid bodies, and whatever effects have been named besides."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        """Motor torque at the joints, N·m, (samples, n), of a motion in rad, rad/s, rad/s² (each samples × n)."""
        ...


@dataclass(frozen=True)
class DecoupledModel:
    """Independent joints of constant inertia, without gravity (Eq. 6.13). ``inertia``: (n,) kg·m²."""

    inertia: Array

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        return np.asarray(ddq * self.inertia)


def mean_inertia(model: InverseModel, q: Array) -> Array:
    """(n,) kg·m²: mean of greatest and least inertia about each joint over the poses ``q`` (poses × n), Section 6.5."""
    rest = np.zeros_like(q)
    weight = model.torque(q, rest, rest)
    columns = []
    for joint in range(q.shape[1]):
        push = rest.copy()
        push[:, joint] = 1.0
        columns.append((model.torque(q, rest, push) - weight)[:, joint])
    about = np.array(columns)
    return np.asarray((about.max(axis=1) + about.min(axis=1)) / 2.0)
