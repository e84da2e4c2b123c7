"""The stand-in's own reading of a URDF: the tree of links, joints and bodies, meshes and limits left aside."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import numpy as np

from config import InputError

Matrix = np.ndarray


@dataclass(frozen=True)
class UrdfBody:
    """Mass in kg, centre in m in the link's frame, inertia about the centre (3 × 3, kg·m²) in the link's directions."""

    mass: float
    centre: np.ndarray
    inertia: np.ndarray


@dataclass(frozen=True)
class UrdfJoint:
    """``position`` (m) and ``rotation`` (3 × 3) place the child's frame in the parent's; ``axis`` is in the child's."""

    name: str
    kind: str
    parent: str
    child: str
    position: np.ndarray
    rotation: np.ndarray
    axis: np.ndarray


@dataclass(frozen=True)
class UrdfTree:
    """``bodies`` holds the links that have an inertial; ``joints`` is by child link."""

    root: str
    links: tuple[str, ...]
    bodies: dict[str, UrdfBody]
    joints: dict[str, UrdfJoint]

    def children(self, link: str) -> list[UrdfJoint]:
        return [j for j in self.joints.values() if j.parent == link]


def rotation_of(roll: float, pitch: float, yaw: float) -> Matrix:
    """Rz(yaw)·Ry(pitch)·Rx(roll), as URDF's rpy means it."""
    cr, sr, cp, sp, cy, sy = (f(a) for a in (roll, pitch, yaw) for f in (math.cos, math.sin))
    return np.array(
        [
            [cy * cp, cy * sp * sr - sy * cr, cy * sp * cr + sy * sr],
            [sy * cp, sy * sp * sr + cy * cr, sy * sp * cr - cy * sr],
            [-sp, cp * sr, cp * cr],
        ]
    )


def read_urdf(path: Path) -> UrdfTree:
    """Read ``path``. Raises InputError for XML that does not parse, a broken tree, a number that is none."""
    try:
        robot = ElementTree.parse(path).getroot()
    except FileNotFoundError:
        raise InputError(str(path), "there is no such file", "check arm.urdf of the installation") from None
    except (OSError, ElementTree.ParseError) as error:
        raise InputError(str(path), f"cannot be read as URDF ({error})", "check the file") from None
    links = tuple(_name(e, path) for e in robot.findall("link"))
    bodies = {
        _name(e, path): _body(inertial, path, _name(e, path))
        for e in robot.findall("link")
        if (inertial := e.find("inertial")) is not None
    }
    joints: dict[str, UrdfJoint] = {}
    for element in robot.findall("joint"):
        joint = _joint(element, path)
        for end in (joint.parent, joint.child):
            if end not in links:
                raise InputError(f"{path}: joint {joint.name}", f"names the link {end!r}, which is not there", "add it")
        if joint.child in joints:
            raise InputError(
                f"{path}: link {joint.child}", "is the child of two joints", "a URDF is a tree; remove one"
            )
        joints[joint.child] = joint
    roots = [link for link in links if link not in joints]
    if len(roots) != 1:
        raise InputError(str(path), f"has {len(roots)} root links ({', '.join(roots)})", "a URDF has one")
    return UrdfTree(roots[0], links, bodies, joints)


def _name(element: ElementTree.Element, path: Path) -> str:
    name = element.get("name")
    if name is None:
        raise InputError(f"{path}: <{element.tag}>", "has no name", "give it one")
    return name


def _numbers(text: str | None, default: tuple[float, ...], place: str) -> np.ndarray:
    if text is None:
        return np.array(default)
    try:
        values = np.array([float(word) for word in text.split()])
    except ValueError:
        raise InputError(place, f"{text!r} is not a row of numbers", "correct it") from None
    if values.shape != (len(default),) or not np.isfinite(values).all():
        raise InputError(place, f"{text!r} is not {len(default)} finite numbers", "correct it")
    return values


def _frame(parent: ElementTree.Element, place: str) -> tuple[np.ndarray, Matrix]:
    origin = parent.find("origin")
    if origin is None:
        return np.zeros(3), np.eye(3)
    zero = (0.0, 0.0, 0.0)
    roll, pitch, yaw = _numbers(origin.get("rpy"), zero, place).tolist()
    return _numbers(origin.get("xyz"), zero, place), rotation_of(roll, pitch, yaw)


def _body(inertial: ElementTree.Element, path: Path, link: str) -> UrdfBody:
    place = f"{path}: link {link}"
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise InputError(place, "its inertial lacks mass or inertia", "give both, or leave the inertial out")
    centre, turn = _frame(inertial, place)
    xx, xy, xz, yy, yz, zz = (
        _numbers(inertia.get(k), (0.0,), place)[0] for k in ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")
    )
    local = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    return UrdfBody(float(_numbers(mass.get("value"), (0.0,), place)[0]), centre, turn @ local @ turn.T)


def _joint(element: ElementTree.Element, path: Path) -> UrdfJoint:
    name = _name(element, path)
    place = f"{path}: joint {name}"
    ends = [e.get("link") if (e := element.find(tag)) is not None else None for tag in ("parent", "child")]
    parent, child = ends
    if parent is None or child is None:
        raise InputError(place, "lacks its parent or its child", "give both")
    axis_element = element.find("axis")
    axis = _numbers(axis_element.get("xyz") if axis_element is not None else None, (1.0, 0.0, 0.0), place)
    if not axis.any():
        raise InputError(place, "its axis is zero", "give a direction")
    position, rotation = _frame(element, place)
    return UrdfJoint(name, element.get("type", ""), parent, child, position, rotation, axis / np.linalg.norm(axis))
