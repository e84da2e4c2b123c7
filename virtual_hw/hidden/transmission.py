"""What lies between motor and link: elasticity, backlash, transmissions that two joints share."""

from __future__ import annotations

from typing import Literal, Self

from pydantic import model_validator

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import NotNegative


class RotorInertia(Section):
    """Inertia of the motor at the joint (rotor times gear ratio squared)."""

    joint: Name
    inertia_kg_m2: Positive


class Elasticity(Section):
    """Motor and link are two masses: τ = k·x + k3·x³ + d·(dθ − dq) with x = θ − q less half the ``gap_rad`` each way.

    Needs the joint's rotor inertia. The gap is backlash; inside it nothing is transmitted.
    """

    joint: Name
    stiffness_nm_rad: Positive
    damping_nms_rad: NotNegative = 0.0
    cubic_nm_rad3: NotNegative = 0.0
    gap_rad: NotNegative = 0.0
    encoder: Literal["motor", "link"] = "motor"


class SharedTransmission(Section):
    """Two joints share a transmission: friction and inertia on the combined speed w = dq + ratio·dq_other.

    The combined coordinate spends b·w + c·sign(w) (bristles) and J·ẇ; the joint feels it once, the
    other ``ratio`` times.
    """

    joint: Name
    joint_other: Name
    ratio: float
    viscous_nms_rad: NotNegative = 0.0
    level_nm: NotNegative = 0.0
    presliding_rad: Positive = 1e-3
    inertia_kg_m2: NotNegative = 0.0

    @model_validator(mode="after")
    def _two_joints(self) -> Self:
        if self.joint == self.joint_other:
            raise ValueError(f"joint_other: {self.joint_other!r} is the joint itself; name another one")
        return self


class TwoMassSpring:
    """Spring with a dead band and a damper, from motor to link."""

    __slots__ = ("_cubic", "_damping", "_half_gap", "_stiffness")

    def __init__(self, law: Elasticity) -> None:
        self._stiffness, self._damping = law.stiffness_nm_rad, law.damping_nms_rad
        self._cubic, self._half_gap = law.cubic_nm_rad3, 0.5 * law.gap_rad

    def torque(self, twist: float, twist_rate: float) -> float:
        """Torque on the link, N·m, for a motor ``twist`` rad ahead of it, gaining ``twist_rate`` rad/s."""
        gap = self._half_gap
        if twist > gap:
            x = twist - gap
        elif twist < -gap:
            x = twist + gap
        else:
            return 0.0
        torque = (self._stiffness + self._cubic * x * x) * x + self._damping * twist_rate
        # Contact in the gap pushes and never pulls.
        if gap and torque * x < 0.0:
            return 0.0
        return torque

    def twist_for(self, torque: float) -> float:
        """The twist in rad that carries ``torque`` (N·m) at rest, by Newton's method on the monotone spring."""
        x = torque / self._stiffness
        for _ in range(20):
            x -= ((self._stiffness + self._cubic * x * x) * x - torque) / (self._stiffness + 3.0 * self._cubic * x * x)
        return x + (self._half_gap if torque > 0.0 else -self._half_gap if torque < 0.0 else 0.0)
