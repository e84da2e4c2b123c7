"""URDF text from Denavit–Hartenberg tables: frames, axes and limits; no inertias, they are what is looked for."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


@dataclass(frozen=True)
class DhRow:
    """One row of a standard Denavit–Hartenberg table: m and rad. ``offset`` is added to the joint's angle."""

    d: float
    a: float
    alpha: float
    offset: float = 0.0


@dataclass(frozen=True)
class JointLimits:
    lower: float
    upper: float
    velocity: float
    effort: float


def urdf_of_standard_dh(
    name: str, rows: Sequence[DhRow], limits: Sequence[JointLimits], base: Array | None = None
) -> str:
    """Joints ``joint1`` … about the z axes of the table's frames; ``base`` (3, 3) turns the first of them.

    In the standard convention joint k turns about the z axis of frame k − 1, and d and a come after the turn: they
    place the next joint.
    """
    links = ["<link name='base'/>"]
    joints: list[str] = []
    rotation, place = np.eye(3) if base is None else base, np.zeros(3)
    for number, (row, limit) in enumerate(zip(rows, limits, strict=True), 1):
        parent = "base" if number == 1 else f"link{number - 1}"
        rotation = rotation @ _about("z", row.offset)
        links.append(f"<link name='link{number}'/>")
        joints.append(
            f"<joint name='joint{number}' type='revolute'><parent link='{parent}'/><child link='link{number}'/>"
            f"<origin xyz='{_row(place)}' rpy='{_row(_roll_pitch_yaw(rotation))}'/><axis xyz='0 0 1'/>"
            f"<limit lower='{limit.lower!r}' upper='{limit.upper!r}' velocity='{limit.velocity!r}' "
            f"effort='{limit.effort!r}'/></joint>"
        )
        rotation, place = _about("x", row.alpha), np.array([row.a, 0.0, row.d])
    return "\n".join([f"<robot name='{name}'>", *links, *joints, "</robot>", ""])


def turned_about_x(angle: float) -> Array:
    """(3, 3) rotation about x by ``angle`` rad."""
    return _about("x", angle)


def _about(axis: str, angle: float) -> Array:
    c, s = np.cos(angle), np.sin(angle)
    if axis == "x":
        return np.array([[1.0, 0.0, 0.0], [0.0, c, -s], [0.0, s, c]])
    return np.array([[c, -s, 0.0], [s, c, 0.0], [0.0, 0.0, 1.0]])


def _roll_pitch_yaw(rotation: Array) -> Array:
    return np.array(
        [
            np.arctan2(rotation[2, 1], rotation[2, 2]),
            -np.arcsin(np.clip(rotation[2, 0], -1.0, 1.0)),
            np.arctan2(rotation[1, 0], rotation[0, 0]),
        ]
    )


def _row(values: Array) -> str:
    return " ".join(repr(float(np.round(value, 15))) for value in values)
