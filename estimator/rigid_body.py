"""The rigid body: a URDF read by pinocchio, unrecorded joints held still, parameters in the thesis' order."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from config import InputError
from config.urdf_numbers import parse_urdf

Array = NDArray[np.float64]

PARAMETERS = ("m", "mcx", "mcy", "mcz", "Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")
"""Inertial parameters of one link about its frame, in the order of the thesis (Eq. 4.1)."""

UNITS = ("kg", "kg·m", "kg·m", "kg·m") + ("kg·m²",) * 6

_ROUNDED_ANGLE = 6e-5
"""rad: half the last digit of an angle with four decimals."""

_FROM_PINOCCHIO = [0, 1, 2, 3, 4, 5, 7, 6, 8, 9]
"""pinocchio has Iyy before Ixz; the permutation is its own inverse."""


def to_thesis_order(parameters: Array) -> Array:
    """Inertial parameters (…, 10) from pinocchio's order to the thesis', or back: the exchange of Ixz and Iyy."""
    return np.asarray(parameters, dtype=float)[..., _FROM_PINOCCHIO]


_SLIDING = {
    "N·m": "N",
    "N·m/rad": "N/m",
    "N·m·s/rad": "N·s/m",
    "rad": "m",
    "rad/s": "m/s",
    "rad/s²": "m/s²",
    "kg·m²": "kg",
}
"""Units of what lives in a sliding joint, by those of a turning one."""


@dataclass(frozen=True)
class Axis:
    """One joint as the kinematics need it: where it sits on its parent, and what it moves along or about."""

    name: str
    parent: int
    """Index of the parent joint, −1 for the base."""
    rotation: Array
    """(3, 3) from the joint's frame at zero to the parent's."""
    translation: Array
    """(3,) of the joint's origin in the parent's frame, m."""
    direction: Array
    """(3,) unit vector in the joint's own frame."""
    revolute: bool

    @property
    def torque_unit(self) -> str:
        """Of what its motor measures: the torque of a sliding joint is a force."""
        return self.unit("N·m")

    def unit(self, turning: str) -> str:
        """The unit in which this joint has what a turning one has in ``turning``."""
        return turning if self.revolute else _SLIDING.get(turning, turning)


@dataclass(frozen=True)
class RigidBody:
    """A tree of rigid links moved by one-degree-of-freedom joints. Make it with `load_rigid_body`.

    All arrays over joints are in the order of ``joints``; inertial parameters are (10·n,) link after link in the
    same order, each link about its joint's frame (the URDF's link frame), `PARAMETERS` within.
    """

    model: Any
    """pinocchio.Model of the moving joints alone."""
    axes: tuple[Axis, ...]
    gravity: Array
    """(3,) m/s² in the base's frame."""
    held: Mapping[str, float] = field(default_factory=dict)
    """Joints of the URDF that do not move, and where they stand (rad or m)."""
    urdf: str = ""
    """The text it was read from."""

    @property
    def joints(self) -> tuple[str, ...]:
        return tuple(axis.name for axis in self.axes)

    @property
    def n(self) -> int:
        """Number of joints, and of moving links."""
        return len(self.axes)

    @property
    def parameter_names(self) -> tuple[str, ...]:
        """Ten a link, the link's number after the symbol as in the thesis: m1, mcx1, …, Izz3."""
        return tuple(f"{symbol}{link}" for link in range(1, self.n + 1) for symbol in PARAMETERS)

    def ancestors(self, link: int) -> tuple[int, ...]:
        """Joints between the base and a link, the link's own joint last."""
        chain: list[int] = []
        while link >= 0:
            chain.append(link)
            link = self.axes[link].parent
        return tuple(reversed(chain))

    def prior(self) -> Array:
        """(10·n,) inertial parameters as the URDF has them (zeros for links without an ``inertial`` element)."""
        return np.concatenate(
            [to_thesis_order(self.model.inertias[k + 1].toDynamicParameters()) for k in range(self.n)]
        )

    def with_parameters(self, parameters: Array) -> RigidBody:
        """The same arm with other inertial parameters (10·n,), physically possible or not.

        Raises InputError when a link has moments but no mass: pinocchio keeps centres, not first moments.
        """
        model = self.model.copy()
        for k, link in enumerate(to_thesis_order(np.reshape(parameters, (self.n, 10)))):
            if link[0] == 0.0 and np.any(link[1:4]):
                raise InputError(f"link of {self.joints[k]}", "has first moments but no mass", "give it a mass")
            model.inertias[k + 1] = pin.Inertia.FromDynamicParameters(link) if link[0] != 0.0 else _massless(link[4:])
        return replace(self, model=model)

    def configuration(self, q: Array) -> Array:
        """pinocchio's configuration vector of one sample of joint positions (n,); continuous joints become two."""
        neutral: Array = pin.neutral(self.model)
        result: Array = pin.integrate(self.model, neutral, np.asarray(q, dtype=float))
        return result

    def columns(self, joints: Sequence[str]) -> list[int]:
        """Where this body's joints are among ``joints``.

        Raises InputError when one is missing or named twice.
        """
        names = list(joints)
        for name in self.joints:
            if names.count(name) != 1:
                raise InputError(
                    "joints",
                    f"joint {name!r} is {'missing' if name not in names else 'named twice'} among {', '.join(names)}",
                    "name the recorded joints as in the URDF",
                )
        return [names.index(name) for name in self.joints]


def load_rigid_body(
    urdf: str | Path,
    joints: Sequence[str] | None = None,
    hold: Mapping[str, float] | None = None,
    gravity: Sequence[float] = (0.0, 0.0, -9.81),
) -> RigidBody:
    """Reads a URDF (a path, or the text itself; meshes are not needed).

    ``joints`` are those that move and are recorded: all others of the URDF are held at ``hold[name]`` or zero and
    their links become part of what carries them. Without ``joints`` all move that ``hold`` does not name.

    Raises InputError for a file that is not a URDF, an unknown joint, a joint of several degrees of freedom.
    """
    place, text = _urdf_text(urdf)
    hold = dict(hold or {})
    try:
        full = pin.buildModelFromXML(text)
    except (RuntimeError, ValueError) as error:
        raise InputError(
            place, f"is not a URDF that pinocchio can read ({str(error).splitlines()[0]})", "check its links and joints"
        ) from None
    known = list(full.names)[1:]
    wanted = [name for name in known if name not in hold] if joints is None else list(joints)
    for name in [*wanted, *hold]:
        if name not in known:
            raise InputError(place, f"has no moving joint {name!r}", f"its joints are {', '.join(known) or 'none'}")
    doubled = sorted({name for name in wanted if wanted.count(name) > 1 or name in hold})
    if doubled:
        raise InputError(
            place, f"joint {', '.join(doubled)} is named twice", "a joint is either recorded or held, once"
        )
    if not wanted:
        raise InputError(place, "has no joint that moves", "name the recorded joints as in the URDF")
    _square_up(full)
    held = {name: float(hold.get(name, 0.0)) for name in known if name not in wanted}
    model = full
    if held:
        stand = np.zeros(full.nv)
        for name, value in held.items():
            joint = full.joints[full.getJointId(name)]
            if joint.nv != 1:
                raise InputError(place, f"joint {name!r} has {joint.nv} degrees of freedom", "hold it by a fixed joint")
            stand[joint.idx_v] = value
        reference = pin.integrate(full, pin.neutral(full), stand)
        model = pin.buildReducedModel(full, [full.getJointId(name) for name in held], reference)
    model.gravity.linear = np.asarray(gravity, dtype=float)
    axes = tuple(_axis(model, index, place) for index in range(1, model.njoints))
    return RigidBody(model, axes, np.asarray(gravity, dtype=float), held, text)


def _square_up(model: Any) -> None:
    """Right angles that a URDF writes with few digits (1.5708) become right angles.

    Frames that are square but for rounding make parameters identifiable in theory that no motion could tell.
    """
    for placement in model.jointPlacements:
        square = np.round(placement.rotation)
        if np.abs(placement.rotation - square).max() < _ROUNDED_ANGLE:
            placement.rotation = square


def _massless(moments: Array) -> pin.Inertia:
    """Moments alone, of either sign: pinocchio's constructor takes none that are not positive."""
    inertia = pin.Inertia.Zero()
    inertia.inertia = _symmetric(moments)
    return inertia


def _symmetric(entries: Array) -> Array:
    """(3, 3) of pinocchio's six: xx, xy, yy, xz, yz, zz."""
    xx, xy, yy, xz, yz, zz = entries
    return np.array([[xx, xy, xz], [xy, yy, yz], [xz, yz, zz]])


def _urdf_text(urdf: str | Path) -> tuple[str, str]:
    """What to call it in a message, and the text."""
    if isinstance(urdf, str) and urdf.lstrip().startswith("<"):
        return "URDF", urdf
    try:
        content = Path(urdf).read_bytes()
        text = content.decode()
    except (OSError, UnicodeDecodeError) as error:
        raise InputError(str(urdf), f"cannot be read ({error})", "give the path of a URDF file") from None
    parse_urdf(content, str(urdf), "give the path of a URDF file")
    return str(urdf), text


def _axis(model: Any, index: int, place: str) -> Axis:
    joint, name, placement = model.joints[index], model.names[index], model.jointPlacements[index]
    if joint.nv != 1:
        raise InputError(
            place, f"joint {name!r} has {joint.nv} degrees of freedom", "only revolute, continuous, prismatic"
        )
    # The motion subspace says axis and kind for every joint type, aligned or not.
    subspace = np.asarray(joint.createData().S).reshape(6)
    revolute = bool(np.linalg.norm(subspace[3:]) > 0.5)
    return Axis(
        name=name,
        parent=int(model.parents[index]) - 1,
        rotation=np.array(placement.rotation, dtype=float),
        translation=np.array(placement.translation, dtype=float),
        direction=np.array(subspace[3:] if revolute else subspace[:3], dtype=float),
        revolute=revolute,
    )
