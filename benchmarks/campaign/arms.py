"""The arms of the campaign: the shipped ones with rotors counted to their links, and URDFs that miss them a little."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path
from xml.etree import ElementTree

import mujoco
import numpy as np
from numpy.random import Generator

from config import Installation, load_installation
from virtual_hw.hidden import HiddenMechanics, load_hidden
from virtual_hw.plant.multibody import build_multibody
from virtual_hw.plant.urdf import UrdfBody, read_urdf

ARMS = ("dda", "puma600", "seven")
"""Three, six and seven joints; only the first has tachometers."""

Bodies = dict[str, UrdfBody]


@dataclass(frozen=True)
class TrueArm:
    """A clean arm: what its bodies really are, and what its sensors' noise is.

    A URDF has no place for the inertia of rotors, so here each is part of the link that it moves: a clean arm is one
    whose URDF can be right.
    """

    installation: Installation
    bodies: Bodies
    noise: HiddenMechanics
    """Of the shipped clean arm; only its sensors' noise is used."""

    @property
    def joints(self) -> tuple[str, ...]:
        return self.installation.joint_names

    def link_of(self, joint: str) -> str:
        """The link that the joint moves."""
        tree = read_urdf(self.installation.path.parent / self.installation.arm.urdf)
        return next(j.child for j in tree.joints.values() if j.name == joint)

    def place_at_home(self, link: str) -> np.ndarray:
        """Where the link's frame is in the base's with the arm at home, m."""
        at_rest = build_multibody(self.installation, HiddenMechanics())
        for dof, angle in zip(at_rest.dof, self.installation.arm.home_rad, strict=True):
            at_rest.data.qpos[dof] = angle
        mujoco.mj_kinematics(at_rest.model, at_rest.data)
        return np.array(at_rest.data.body(link).xpos)


def true_arm(name: str) -> TrueArm:
    """A shipped arm by name; raises InputError for an unknown one."""
    installation = load_installation(name)
    clean = load_hidden(installation, f"{name}-clean")
    tree = read_urdf(installation.path.parent / installation.arm.urdf)
    bodies = dict(tree.bodies)
    for rotor in clean.rotor_inertia:
        joint = next(j for j in tree.joints.values() if j.name == rotor.joint)
        bodies[joint.child] = with_rotor(bodies[joint.child], joint.axis, rotor.inertia_kg_m2)
    return TrueArm(installation, bodies, clean)


def with_rotor(body: UrdfBody, axis: np.ndarray, inertia: float) -> UrdfBody:
    """The body with a thin disc of moment ``inertia`` (kg·m²) about ``axis`` more."""
    disc = 0.5 * inertia * (np.eye(3) + np.outer(axis, axis))
    return UrdfBody(body.mass, body.centre, body.inertia + disc)


def without_moment(body: UrdfBody, axis: np.ndarray, inertia: float) -> UrdfBody:
    """The body with so much less moment of inertia about ``axis``, and as much as before about the others."""
    return UrdfBody(body.mass, body.centre, body.inertia - inertia * np.outer(axis, axis))


def scattered(bodies: Bodies, share: float, rng: Generator) -> Bodies:
    """Bodies whose mass, inertia and place of the centre are each wrong by up to ``share`` (0.05: five per cent)."""
    wrong = {}
    for link, body in bodies.items():
        mass, inertia = 1.0 + share * rng.uniform(-1.0, 1.0, 2)
        centre = body.centre + share * np.linalg.norm(body.centre) * rng.uniform(-1.0, 1.0, 3)
        wrong[link] = UrdfBody(body.mass * mass, centre, body.inertia * mass * inertia)
    return wrong


def write_urdf(arm: TrueArm, bodies: Bodies, path: Path) -> None:
    """The arm's URDF with these bodies in place of its own, and no remark of where they come from."""
    robot = ElementTree.parse(arm.installation.path.parent / arm.installation.arm.urdf).getroot()
    for link in robot.findall("link"):
        inertial, body = link.find("inertial"), bodies.get(link.get("name", ""))
        if inertial is None or body is None:
            continue
        link.remove(inertial)
        fresh = ElementTree.SubElement(link, "inertial")
        ElementTree.SubElement(fresh, "origin", xyz=" ".join(f"{x:.12g}" for x in body.centre), rpy="0 0 0")
        ElementTree.SubElement(fresh, "mass", value=f"{body.mass:.12g}")
        moments = {f"i{a}{b}": f"{body.inertia[i, j]:.12g}" for (i, a), (j, b) in _UPPER}
        ElementTree.SubElement(fresh, "inertia", moments)
    ElementTree.indent(robot)
    path.write_text(ElementTree.tostring(robot, encoding="unicode") + "\n", encoding="utf-8")


_AXES = tuple(enumerate("xyz"))
_UPPER = [(a, b) for a in _AXES for b in _AXES if a[0] <= b[0]]


def hidden_bodies(bodies: Bodies) -> list[dict[str, object]]:
    """The bodies as ``[[link]]`` entries of hidden mechanics: the truth, whatever the URDF says."""
    return [
        {
            "link": link,
            "mass_kg": body.mass,
            "centre_m": body.centre.tolist(),
            "inertia_kg_m2": [float(body.inertia[i, j]) for (i, _), (j, _) in _UPPER],
        }
        for link, body in bodies.items()
        if body.mass > 0.0
    ]
