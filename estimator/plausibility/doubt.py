"""One thing that is wrong with recordings, in words fit to be shown."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

Kind = Literal[
    "angles in degrees",
    "velocities in degrees",
    "velocity scale",
    "velocity sign",
    "velocity order",
    "dead velocity channel",
    "torque scale",
    "torque sign",
    "joint turned round",
    "angle sign",
    "angle zero",
    "joint order",
    "torque order",
    "angle order",
    "another arm",
    "torque cut off",
    "dead torque channel",
    "too short",
]


@dataclass(frozen=True)
class Doubt:
    """``wrong``: certain enough that nothing may be fitted over it; otherwise it is a warning."""

    kind: Kind
    joints: tuple[str, ...]
    problem: str
    remedy: str
    evidence: float
    """The number behind it, as `problem` quotes it: a ratio, a scale or a share."""
    wrong: bool

    def __str__(self) -> str:
        return f"{self.problem}; {self.remedy}"


def times(ratio: float) -> str:
    """A ratio as one says it: three digits, and thousands in full."""
    return f"{ratio:.3g}" if abs(ratio) < 1000.0 else f"{ratio:.0f}"
