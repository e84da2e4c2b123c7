"""An arm as URDF or MJCF text, and what these cannot say of it."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any, Literal
from xml.etree import ElementTree

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.arm_model import ArmModel, FittedEffect
from estimator.consistency import is_consistent
from estimator.parallel_axis import about_centre
from estimator.rigid_body import RigidBody
from estimator.twin.mujoco_plant import mjcf_of, possible_bodies
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]
Kind = Literal["mjcf", "urdf"]
HELD: Mapping[Kind, frozenset[str]] = {
    "urdf": frozenset({"parameters", "viscous", "friction"}),
    "mjcf": frozenset(
        {"parameters", "viscous", "friction", "armature", "stiffness", "centre", "gravity", "gain", "offset"}
        | {"series", "couplings"}
    ),
}
"""Fields of `PlantDraft` that each format has elements for."""


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


def model_mjcf(model: ArmModel) -> str:
    """The model as MuJoCo's MJCF: bodies, damping, dry friction, rotors, springs, elastic transmissions and gaps,
    shared transmissions, motors with gain and offset, tilted gravity.

    Raises InputError when MuJoCo refuses it.
    """
    return mjcf_of(model.plant())


def model_urdf(model: ArmModel) -> str:
    """The model as URDF: bodies, and each joint's ``dynamics`` (viscous and dry friction), which is all that URDF has.

    Raises InputError when no bodies can have nearly its parameters.
    """
    plant = model.plant()
    root = ElementTree.fromstring(urdf_text(model.body, possible_bodies(plant)))
    joints = {joint.get("name"): joint for joint in root.findall("joint")}
    for name, viscous, dry in zip(model.body.joints, plant.viscous, plant.friction, strict=True):
        joint = joints[name]
        for stale in joint.findall("dynamics"):
            joint.remove(stale)
        if viscous or dry:
            ElementTree.SubElement(joint, "dynamics", damping=repr(float(viscous)), friction=repr(float(dry)))
    ElementTree.indent(root)
    return ElementTree.tostring(root, encoding="unicode") + "\n"


@dataclass(frozen=True)
class Left:
    """An effect that a format cannot hold, or only a part of it."""

    effect: FittedEffect
    partly: bool
    """Whether something of it is written: of Stribeck friction the Coulomb level and the viscous coefficient."""


def left_out(model: ArmModel, kind: Kind) -> list[Left]:
    """What is not in the exported file: found by what each effect changes in the plant."""
    found = []
    for one in model.effects:
        before = PlantDraft(model.body, model.body.prior())
        after = PlantDraft(model.body, model.body.prior())
        one.simulate(after)
        changed = {name for name in vars(after) if name != "body" and _differs(vars(before)[name], vars(after)[name])}
        if not changed <= HELD[kind] or not changed:
            found.append(Left(one, bool(changed & HELD[kind])))
    return found


def _differs(one: Any, other: Any) -> bool:
    return not np.array_equal(one, other) if isinstance(one, np.ndarray) else bool(one != other)


def _set_inertial(link: ElementTree.Element, values: Array) -> None:
    """Mass, centre and inertia about the centre, axes parallel to the link's frame."""
    m, first = values[0], values[1:4]
    centre = first / m
    stale = link.find("inertial")
    if stale is not None:
        link.remove(stale)
    inertial = ElementTree.SubElement(link, "inertial")
    ElementTree.SubElement(inertial, "origin", xyz=" ".join(repr(float(x)) for x in centre), rpy="0 0 0")
    ElementTree.SubElement(inertial, "mass", value=repr(float(m)))
    entries = dict(zip(("ixx", "ixy", "ixz", "iyy", "iyz", "izz"), about_centre(values), strict=True))
    ElementTree.SubElement(inertial, "inertia", {name: repr(float(value)) for name, value in entries.items()})
