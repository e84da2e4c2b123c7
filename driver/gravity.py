"""The rigid body as the loop needs it: gravity torque for stops and holding, inverse dynamics for computed torque."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from config import InputError, Installation

Array = NDArray[np.float64]


class RigidBody:
    """Rigid-body torques of the installation's joints, in its order, by Pinocchio; other joints stay at neutral.

    ``urdf`` is the text of a model to use in place of the installation's. Raises InputError when it cannot be read
    or lacks a joint.
    """

    def __init__(self, installation: Installation, urdf: str | None = None) -> None:
        source = "the plan's model"
        if urdf is None:
            path = installation.path.parent / installation.arm.urdf
            source, urdf = str(path), _read(path)
        try:
            full = pin.buildModelFromXML(urdf)
        except (ValueError, RuntimeError) as error:
            raise InputError(source, f"is not a URDF that can be used ({error})") from None
        names = installation.joint_names
        for name in names:
            if not full.existJointName(name):
                raise InputError(source, f"has no movable joint {name!r}", "name the joints as the installation does")
        rest = [k for k in range(1, full.njoints) if full.names[k] not in names]
        self.model = pin.buildReducedModel(full, rest, pin.neutral(full)) if rest else full
        self.model.gravity.linear = np.array(installation.arm.gravity_m_s2)
        self.data = self.model.createData()
        joints = [self.model.joints[self.model.getJointId(name)] for name in names]
        for name, joint in zip(names, joints, strict=True):
            if joint.nv != 1:
                raise InputError(source, f"joint {name!r} has {joint.nv} degrees of freedom", "one a drive is possible")
        # A "continuous" joint is (cos q, sin q) in Pinocchio's configuration vector.
        self._turning = [(i, j.idx_q) for i, j in enumerate(joints) if j.nq == 2]
        self._plain = [(i, j.idx_q) for i, j in enumerate(joints) if j.nq == 1]
        self._v = np.array([j.idx_v for j in joints])
        self._ordered = self.model.nq == len(joints) and [k for _, k in self._plain] == list(range(len(joints)))
        self._q = pin.neutral(self.model)
        self._zero = np.zeros(self.model.nv)

    def gravity(self, q: Sequence[float]) -> list[float]:
        """Torque [N·m] that holds the arm at rest at q [rad], one a joint."""
        tau = pin.computeGeneralizedGravity(self.model, self.data, self._configuration(q))
        return self._out(tau)

    def inverse_dynamics(self, q: Sequence[float], dq: Sequence[float], ddq: Sequence[float]) -> list[float]:
        """Torque [N·m] of the motion q [rad], dq [rad/s], ddq [rad/s²]: recursive Newton–Euler."""
        tau = pin.rnea(self.model, self.data, self._configuration(q), self._in(dq), self._in(ddq))
        return self._out(tau)

    def _configuration(self, q: Sequence[float]) -> Array:
        if self._ordered:
            return np.array(q)
        out: Array = self._q
        for i, k in self._plain:
            out[k] = q[i]
        for i, k in self._turning:
            out[k], out[k + 1] = np.cos(q[i]), np.sin(q[i])
        return out

    def _in(self, values: Sequence[float]) -> Array:
        if self._ordered:
            return np.array(values)
        out: Array = self._zero.copy()
        out[self._v] = values
        return out

    def _out(self, tau: Array) -> list[float]:
        values: list[float] = (tau if self._ordered else tau[self._v]).tolist()
        return values


def _read(path: Path) -> str:
    try:
        return path.read_text()
    except OSError as error:
        raise InputError(str(path), f"cannot be read ({error.strerror})", "correct arm.urdf") from None
