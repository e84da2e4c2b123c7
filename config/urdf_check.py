"""Does the URDF fit the installation? Joints, their order and limits, and the frames that are named."""

from __future__ import annotations

import math
from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

from config.errors import InputError
from config.schema import Installation
from config.toml_file import nearest, shown
from config.urdf_numbers import masses, parse_urdf

_MOVABLE = {"revolute", "continuous", "prismatic", "planar", "floating"}
_TOLERANCE_RAD = 1e-6


@dataclass(frozen=True)
class UrdfJointOutline:
    """A joint as far as the installation must agree with it. ``limits`` is None for a joint that turns for ever."""

    name: str
    kind: str
    parent: str
    child: str
    limits: tuple[float, float] | None
    velocity: float | None
    effort: float | None


@dataclass(frozen=True)
class UrdfOutline:
    """Links and joints by name, in the file's order."""

    links: tuple[str, ...]
    joints: dict[str, UrdfJointOutline]
    masses: dict[str, float]
    """kg, by link."""

    def above(self, joint: str) -> set[str]:
        """The joints between the root and ``joint``."""
        by_child = {j.child: j for j in self.joints.values()}
        found: set[str] = set()
        link = self.joints[joint].parent
        while link in by_child and by_child[link].name not in found:
            found.add(by_child[link].name)
            link = by_child[link].parent
        return found

    def carries(self, joint: str) -> float:
        """Mass of all links that ``joint`` moves, kg."""
        return self.masses.get(self.joints[joint].child, 0.0) + sum(
            self.masses.get(other.child, 0.0) for name, other in self.joints.items() if joint in self.above(name)
        )


def read_outline(path: Path) -> UrdfOutline:
    """Links and joints of ``path``. Raises InputError when it is absent, no URDF, or a number in it is none."""
    try:
        robot = parse_urdf(path.read_bytes(), shown(path), "check arm.urdf")
    except OSError as error:
        raise InputError(shown(path), f"cannot be read ({error.strerror})", "check arm.urdf") from None
    joints = {j.name: j for j in (_joint(element, path) for element in robot.findall("joint"))}
    return UrdfOutline(tuple(e.get("name", "") for e in robot.findall("link")), joints, masses(robot))


def check_urdf(installation: Installation, place: str) -> None:
    """Raise InputError, naming the key, where installation and URDF contradict each other."""
    path = installation.path.parent / installation.arm.urdf
    urdf, outline = shown(path), read_outline(path)
    movable = {n for n, j in outline.joints.items() if j.kind in _MOVABLE}
    configured = installation.joint_names
    for k, joint in enumerate(installation.joint):
        key = f"{place}: joint[{k}]"
        if joint.name not in movable:
            raise InputError(f"{key}.name", f"{urdf} has no movable joint {joint.name!r}", nearest(joint.name, movable))
        found = outline.joints[joint.name]
        if found.kind not in ("revolute", "continuous"):
            raise InputError(f"{key}.name", f"{joint.name} is {found.kind} in {urdf}", "configure turning joints only")
        for later in outline.above(joint.name) & set(configured[k + 1 :]):
            raise InputError(
                f"{key}.name", f"{joint.name} comes before {later}, which carries it", "order from the base"
            )
        if outline.carries(joint.name) == 0.0:
            raise InputError(
                f"{key}.name",
                f"nothing that {joint.name} moves has a mass in {urdf}, so gravity could not be held",
                "give its links an <inertial>",
            )
        _check_limits(installation, k, found, f"{key}.limits", urdf)
    if missing := sorted(movable - set(configured)):
        raise InputError(
            f"{place}: joint",
            f"{', '.join(missing)} of {urdf} moves and has no drive",
            "add a [[joint]], or fix it there",
        )
    frames = [("arm.tool_frame", installation.arm.tool_frame)]
    frames += [(f"wrench_sensor[{k}].frame", s.frame) for k, s in enumerate(installation.wrench_sensor)]
    for key, frame in frames:
        if frame not in outline.links:
            raise InputError(f"{place}: {key}", f"{urdf} has no link {frame!r}", nearest(frame, outline.links))


def _check_limits(installation: Installation, k: int, found: UrdfJointOutline, key: str, urdf: str) -> None:
    limits = installation.joint[k].limits
    low, high = limits.position_rad
    if found.limits is not None and (low < found.limits[0] - _TOLERANCE_RAD or high > found.limits[1] + _TOLERANCE_RAD):
        raise InputError(
            f"{key}.position_rad ({found.name})",
            f"[{low}, {high}] goes beyond [{found.limits[0]}, {found.limits[1]}] of {urdf}",
            "narrow it, or correct the URDF",
        )
    for name, value, bound in (
        ("velocity_rad_s", limits.velocity_rad_s, found.velocity),
        ("torque_nm", limits.torque_nm, found.effort),
    ):
        if bound is not None and value > bound:
            raise InputError(
                f"{key}.{name} ({found.name})", f"{value:g} is more than the {bound:g} of {urdf}", "lower it"
            )


def _joint(element: ElementTree.Element, path: Path) -> UrdfJointOutline:
    name = element.get("name", "")
    kind = element.get("type", "")
    limit, parent, child = element.find("limit"), element.find("parent"), element.find("child")
    if not name or parent is None or child is None:
        raise InputError(f"{shown(path)}: joint {name!r}", "lacks its name, parent or child", "complete it")

    def number(key: str) -> float | None:
        text = None if limit is None else limit.get(key)
        try:
            value = None if text is None else float(text)
        except ValueError:
            value = math.nan
        if value is not None and math.isnan(value):
            raise InputError(f"{shown(path)}: joint {name!r}", f"limit {key}={text!r} is no number", "correct it")
        return value

    low, high = number("lower"), number("upper")
    bounded = kind in ("revolute", "prismatic") and low is not None and high is not None
    return UrdfJointOutline(
        name,
        kind,
        parent.get("link", ""),
        child.get("link", ""),
        (low, high) if bounded and low is not None and high is not None else None,
        number("velocity"),
        number("effort"),
    )
