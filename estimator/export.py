"""The identified arm as URDF or MJCF text."""

from __future__ import annotations

from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.consistency import is_consistent
from estimator.identification import LinkIdentification
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


def urdf_text(body: RigidBody, parameters: Array) -> str:
    """The arm's URDF with new inertial parameters (10·n,), all else as it was.

    What is fixed or held to a moving link is part of it, so those links lose their own ``inertial`` element.
    Raises InputError when no body can have the parameters (see `estimator.consistency`).
    """
    possible = is_consistent(parameters)
    if not possible.all():
        impossible = ", ".join(body.joints[k] for k in np.flatnonzero(~possible))
        raise InputError("parameters", f"no body moved by {impossible} can have them", "export the consistent set")
    root = ElementTree.fromstring(body.urdf)
    links = {link.get("name"): link for link in root.iter("link")}
    child_of: dict[str | None, str | None] = {}
    for joint in root.findall("joint"):
        child = joint.find("child")
        child_of[joint.get("name")] = None if child is None else child.get("link")
    carried = {child_of[name] for name in child_of if name not in body.joints}
    for name, link in links.items():
        stale = link.find("inertial")
        if stale is not None and name in carried:
            link.remove(stale)
    for joint_name, values in zip(body.joints, np.reshape(parameters, (-1, 10)), strict=True):
        _set_inertial(links[child_of[joint_name]], values)
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def mjcf_text(found: LinkIdentification, parameters: Array) -> str:
    """The same arm as MuJoCo's MJCF, with the identified viscous and Coulomb friction and rotor inertias.

    Raises InputError when MuJoCo refuses the bodies, or no body can have the parameters.
    """
    try:
        spec = mujoco.MjSpec.from_string(urdf_text(found.body, parameters))
        spec.compile()
        root = ElementTree.fromstring(spec.to_xml())
    except ValueError as error:
        raise InputError("MJCF", f"MuJoCo refuses the arm ({error})", "export URDF instead") from None
    joints = {joint.get("name"): joint for joint in root.iter("joint")}
    attributes = {"viscous_friction": "damping", "coulomb_friction": "frictionloss", "rotor_inertia": "armature"}
    for term, value in zip(found.terms, found.value[found.base.rank :], strict=True):
        if term.name in attributes and value > 0.0:
            joints[found.body.joints[term.joint]].set(attributes[term.name], repr(float(value)))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


def _set_inertial(link: ElementTree.Element, values: Array) -> None:
    """Mass, centre and inertia about the centre, axes parallel to the link's frame."""
    m, first = values[0], values[1:4]
    centre = first / m
    xx, xy, xz, yy, yz, zz = values[4:]
    about_frame = np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])
    about_centre = about_frame - m * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    stale = link.find("inertial")
    if stale is not None:
        link.remove(stale)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in centre), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(m)))
    entries = {
        f"i{a}{b}": about_centre["xyz".index(a), "xyz".index(b)] for a, b in ("xx", "xy", "xz", "yy", "yz", "zz")
    }
    ElementTree.SubElement(inertial, "inertia", {name: repr(float(value)) for name, value in entries.items()})
