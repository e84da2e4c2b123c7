"""What a joint adds to the rigid body, linear in its parameters: friction, rotor inertia, offset.

Names are those of the catalogue of effects. ``tau = rigid body + sum of terms``.
"""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

TermName = Literal["viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset"]
TERM_NAMES: tuple[TermName, ...] = ("viscous_friction", "coulomb_friction", "rotor_inertia", "torque_offset")

NEVER_NEGATIVE: tuple[TermName, ...] = ("viscous_friction", "coulomb_friction", "rotor_inertia")
"""Friction only brakes, and no rotor weighs less than nothing: a negative value stands for something else."""

PARAMETER_OF: dict[TermName, tuple[str, str]] = {
    "viscous_friction": ("coefficient", "N·m·s/rad"),
    "coulomb_friction": ("level", "N·m"),
    "rotor_inertia": ("inertia", "kg·m²"),
    "torque_offset": ("offset", "N·m"),
}


_SLIDING = {"N·m·s/rad": "N·s/m", "N·m": "N", "kg·m²": "kg"}


def unit_of(name: TermName, revolute: bool) -> str:
    """Of the term's parameter, on a joint that turns or slides."""
    unit = PARAMETER_OF[name][1]
    return unit if revolute else _SLIDING[unit]


@dataclass(frozen=True)
class Term:
    """One column of one joint."""

    name: TermName
    joint: int
    width: float = 0.0
    """rad/s (m/s): Coulomb friction is level·tanh(dq/width), the sigmoid that presliding makes of the sign."""

    @property
    def linear(self) -> bool:
        """Whether the column is linear in velocity and acceleration, and so has no frequencies that they have not."""
        return self.name in ("viscous_friction", "rotor_inertia")

    def column(self, dq: Array, ddq: Array) -> Array:
        """The torque of a unit parameter, over samples of this joint's velocity (rad/s) and acceleration (rad/s²)."""
        if self.name == "viscous_friction":
            return dq
        if self.name == "coulomb_friction":
            # In single precision, right to 1e-7 of the level, it takes a sixth of the time.
            return np.tanh((dq / self.width).astype(np.float32)).astype(float)
        if self.name == "rotor_inertia":
            return ddq
        return np.ones_like(dq)


def candidate_terms(names: tuple[TermName, ...], widths: Array) -> list[list[Term]]:
    """Candidates of every joint; ``widths`` (n, k) rad/s are the sigmoid's widths to choose from."""
    result: list[list[Term]] = []
    for joint, choices in enumerate(widths):
        terms: list[Term] = []
        for name in names:
            if name == "coulomb_friction":
                terms += [Term(name, joint, float(width)) for width in choices]
            else:
                terms.append(Term(name, joint))
        result.append(terms)
    return result
