"""A URDF's numbers: bodies, axes, frames. Readers drop in silence what they cannot take, an inertial whose mass is
"3 kg" for instance, and would go on with another arm; here such a file is refused."""

from __future__ import annotations

import math
from xml.etree import ElementTree

from config.errors import InputError

_TURNS_OR_SLIDES = {"revolute", "continuous", "prismatic", "planar"}
_MOMENTS = ("ixx", "ixy", "ixz", "iyy", "iyz", "izz")


def parse_urdf(content: bytes, place: str, remedy: str) -> ElementTree.Element:
    """The <robot> element, its numbers checked.

    Raises InputError for what is no XML, no URDF, or has a mass, moment, axis or frame that cannot be one.
    """
    try:
        robot = ElementTree.fromstring(content)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(place, f"is not XML ({error})", remedy) from None
    if robot.tag != "robot":
        raise InputError(place, f"is not a URDF: its root is <{robot.tag}>, not <robot>", remedy)
    for link in robot.findall("link"):
        _check_body(link, f"{place}: link {link.get('name', '')!r}")
    for joint in robot.findall("joint"):
        _check_joint(joint, f"{place}: joint {joint.get('name', '')!r}")
    return robot


def masses(robot: ElementTree.Element) -> dict[str, float]:
    """Mass of each link [kg], of a checked URDF; 0 without an <inertial>."""
    found = {link.get("name", ""): link.find("inertial/mass") for link in robot.findall("link")}
    return {name: 0.0 if mass is None else float(mass.get("value", "0")) for name, mass in found.items()}


def _check_body(link: ElementTree.Element, place: str) -> None:
    inertial = link.find("inertial")
    if inertial is None:
        return
    mass, inertia = inertial.find("mass"), inertial.find("inertia")
    if mass is None or inertia is None:
        raise InputError(place, "its <inertial> lacks <mass> or <inertia>", "give both, or leave the <inertial> out")
    if _numbers(mass, "value", 1, place)[0] < 0.0:
        raise InputError(place, f"its mass {mass.get('value')} kg is negative", "correct it")
    for key in _MOMENTS:
        _numbers(inertia, key, 1, place)
    _check_origin(inertial, place)


def _check_joint(joint: ElementTree.Element, place: str) -> None:
    _check_origin(joint, place)
    axis = joint.find("axis")
    if axis is not None and joint.get("type") in _TURNS_OR_SLIDES and not any(_numbers(axis, "xyz", 3, place)):
        raise InputError(place, "its axis is zero", "give a direction")


def _check_origin(element: ElementTree.Element, place: str) -> None:
    origin = element.find("origin")
    for key in ("xyz", "rpy") if origin is not None else ():
        if origin is not None and origin.get(key) is not None:
            _numbers(origin, key, 3, place)


def _numbers(element: ElementTree.Element, key: str, count: int, place: str) -> list[float]:
    text = element.get(key)
    if text is None:
        raise InputError(place, f"its <{element.tag}> has no {key}", "give it")
    wanted = "a finite number" if count == 1 else f"{count} finite numbers"
    try:
        numbers = [float(word) for word in text.split()]
    except ValueError:
        numbers = []
    if len(numbers) != count or not all(map(math.isfinite, numbers)):
        raise InputError(
            place, f"its <{element.tag} {key}={text!r}> is not {wanted}", "write SI units, without their names"
        )
    return numbers
