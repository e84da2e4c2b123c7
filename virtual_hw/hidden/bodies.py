"""The true rigid bodies: links, payloads, loads that slosh, the stand of the arm."""

from __future__ import annotations

import math
from typing import Annotated, Self

import numpy as np
from pydantic import Field, model_validator

from config.schema import Name, Positive, Section
from virtual_hw.hidden.quantities import Fraction, NotNegative, Vector3

Inertia = tuple[float, float, float, float, float, float]
"""xx, xy, xz, yy, yz, zz in kg·m²."""


def inertia_matrix(inertia: Inertia) -> np.ndarray:
    xx, xy, xz, yy, yz, zz = inertia
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


class RigidBody(Section):
    mass_kg: Positive
    centre_m: Vector3 = (0.0, 0.0, 0.0)
    """In the frame the body is given in."""
    inertia_kg_m2: Inertia
    """xx, xy, xz, yy, yz, zz about the centre, in that frame's directions."""

    @model_validator(mode="after")
    def _possible(self) -> Self:
        principal = np.linalg.eigvalsh(inertia_matrix(self.inertia_kg_m2))
        if principal[0] <= 0 or principal[2] > (principal[0] + principal[1]) * (1 + 1e-9):
            shown = ", ".join(f"{p:.4g}" for p in principal)
            raise ValueError(
                f"inertia_kg_m2: principal moments {shown} belong to no body; "
                "each must be positive and less than the sum of the other two"
            )
        return self


class Link(RigidBody):
    """The true body of a URDF link, in the link's frame. Links that are not listed are as the URDF says."""

    link: Name


class LinkChange(Section):
    """A link that differs from its URDF body (or from its ``[[link]]``)."""

    link: Name
    mass_factor: Positive = 1.0
    """Scales mass and inertia."""
    inertia_factor: Positive = 1.0
    """Scales the inertia besides."""
    centre_shift_m: Vector3 = (0.0, 0.0, 0.0)


class InertiaExcess(Section):
    """Inertia that a link has beyond its body, of either sign, in the link's directions.

    For arms known by estimated base parameters alone: those need not be any body's.
    """

    link: Name
    inertia_kg_m2: Inertia


class Payload(RigidBody):
    """A rigid load in the tool's frame, from ``from_s`` on until ``until_s``."""

    from_s: NotNegative = 0.0
    until_s: Positive | None = None


class SloshingLoad(Section):
    """A mass in the tool's frame that swings in x and y on springs about ``centre_m``: a load that is not rigid."""

    mass_kg: Positive
    centre_m: Vector3
    radius_m: Positive = 0.02
    """Of the ball it is; its inertia is 2/5·m·r²."""
    frequency_hz: Positive
    damping: Fraction
    """Damping ratio."""


class BaseTilt(Section):
    """The stand is turned by roll about x, then pitch about y: gravity in the base frame is R(pitch, roll)ᵀ·g."""

    roll_rad: Annotated[float, Field(ge=-math.pi, le=math.pi)] = 0.0
    pitch_rad: Annotated[float, Field(ge=-math.pi, le=math.pi)] = 0.0

    def gravity(self, gravity_m_s2: Vector3) -> Vector3:
        """Gravity in the tilted base's frame, m/s²."""
        cr, sr = math.cos(self.roll_rad), math.sin(self.roll_rad)
        cp, sp = math.cos(self.pitch_rad), math.sin(self.pitch_rad)
        x, y, z = gravity_m_s2
        x, z = cp * x - sp * z, sp * x + cp * z
        return x, cr * y + sr * z, -sr * y + cr * z
