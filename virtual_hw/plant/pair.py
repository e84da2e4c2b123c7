"""Torques between two joints: a transmission they share, the beat of their gears."""

from __future__ import annotations

import math

import mujoco

from virtual_hw.hidden.friction import BristleFriction, Friction
from virtual_hw.hidden.periodic import GearMesh
from virtual_hw.hidden.transmission import SharedTransmission


class SharedShaft:
    """Friction and inertia on w = dq + ratio·dq_other.

    The combined coordinate is a fixed tendon of the model: its armature carries the inertia, and the friction's
    implicit part, exactly.
    """

    __slots__ = ("_a", "_b", "_friction", "_inertia", "_model", "_ratio", "_tendon")

    def __init__(self, law: SharedTransmission, a: int, b: int, model: mujoco.MjModel, tendon: int) -> None:
        self._a, self._b, self._ratio, self._inertia = a, b, law.ratio, law.inertia_kg_m2
        self._model, self._tendon = model, tendon
        self._friction = BristleFriction(
            Friction(
                joint=law.joint,
                level_nm=law.level_nm,
                viscous_nms_rad=law.viscous_nms_rad,
                presliding_rad=law.presliding_rad,
            )
        )

    def load(self, dq: list[float], applied: list[float], h: float) -> None:
        a, b, ratio, friction = self._a, self._b, self._ratio, self._friction
        w = dq[a] + ratio * dq[b]
        friction.linearise(0.0, w, w, 0.0, 0.0, 0.0, h)
        spent = friction.explicit + friction.implicit * w
        applied[a] -= spent
        applied[b] -= ratio * spent
        self._model.tendon_armature[self._tendon] = self._inertia + h * friction.implicit

    def settle(self, dq: list[float], h: float) -> None:
        self._friction.settle(dq[self._a] + self._ratio * dq[self._b], h)


class MeshBeat:
    """a·sin(k·q + k_other·q_other + φ), spent by both."""

    __slots__ = ("_a", "_b", "_law")

    def __init__(self, law: GearMesh, a: int, b: int) -> None:
        self._law, self._a, self._b = law, a, b

    def load(self, q: list[float], applied: list[float]) -> None:
        law = self._law
        phase = law.order * q[self._a] + law.order_other * q[self._b] + law.phase_rad
        spent = law.amplitude_nm * math.sin(phase)
        applied[self._a] -= spent
        applied[self._b] -= law.ratio * spent
