"""The rigid bodies as a MuJoCo model: the URDF's kinematics with the true bodies, loads and compliant sensors."""

from __future__ import annotations

import math
from dataclasses import dataclass

import mujoco
import numpy as np

from config import InputError, Installation
from virtual_hw.hidden.bodies import InertiaExcess, RigidBody, inertia_matrix
from virtual_hw.hidden.mechanics import HiddenMechanics
from virtual_hw.plant.urdf import UrdfBody, UrdfJoint, UrdfTree, read_urdf

SLIDE_AXES = {"x": (1.0, 0.0, 0.0), "y": (0.0, 1.0, 0.0), "z": (0.0, 0.0, 1.0)}
SENSOR_AXES = SLIDE_AXES | {f"r{k}": v for k, v in SLIDE_AXES.items()}


@dataclass(frozen=True)
class Multibody:
    """``dof[i]`` is where joint i of the installation stands in MuJoCo's vectors; ``loose`` are the degrees of
    freedom without a motor (index, stiffness, damping ratio), on springs of MuJoCo's own.
    """

    model: mujoco.MjModel
    data: mujoco.MjData
    dof: tuple[int, ...]
    loose: tuple[tuple[int, float, float], ...]


def build_multibody(installation: Installation, hidden: HiddenMechanics) -> Multibody:
    """Assemble and compile. Raises InputError where URDF, installation and hidden mechanics do not fit each other."""
    path = installation.path.parent / installation.arm.urdf
    tree = read_urdf(path)
    assembly = _Assembly(installation, hidden, tree, str(path))
    spec = assembly.spec
    try:
        model = spec.compile()
    except ValueError as error:
        raise InputError(str(path), f"the bodies make no mechanical model: {error}", "check the inertials") from None
    for excess in hidden.inertia_excess:
        _add_inertia(model, excess)
    model.opt.disableflags |= int(
        mujoco.mjtDisableBit.mjDSBL_CONSTRAINT
        | mujoco.mjtDisableBit.mjDSBL_CONTACT
        | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    )
    data = mujoco.MjData(model)
    # MuJoCo's profiling clock costs more than half of an evaluation of a small arm.
    mujoco.set_mjcb_time(None)
    dof = tuple(int(model.joint(name).dofadr[0]) for name in installation.joint_names)
    loose = []
    for name, stiffness, ratio in assembly.loose:
        model.jnt_stiffness[model.joint(name).id] = stiffness
        loose.append((int(model.joint(name).dofadr[0]), stiffness, ratio))
    return Multibody(model, data, dof, tuple(loose))


def _add_inertia(model: mujoco.MjModel, excess: InertiaExcess) -> None:
    """Add to a link's inertia after compiling, which refuses what no body has. Inertia without mass has no centre."""
    link = model.body(excess.link)
    turn = np.empty(9)
    mujoco.mju_quat2Mat(turn, link.iquat)
    axes = turn.reshape(3, 3)
    total = axes @ np.diag(link.inertia) @ axes.T + inertia_matrix(excess.inertia_kg_m2)
    principal, directions = np.linalg.eigh(total)
    link.inertia[:] = principal
    link.iquat[:] = _quaternion(directions * np.linalg.det(directions))


class _Assembly:
    def __init__(self, installation: Installation, hidden: HiddenMechanics, tree: UrdfTree, place: str) -> None:
        self.installation, self.hidden, self.tree, self.place = installation, hidden, tree, place
        self.loose: list[tuple[str, float, float]] = []
        """Name, stiffness, damping ratio."""
        self._check_frames()
        self.bodies = self._true_bodies()
        self.spec = mujoco.MjSpec()
        self.spec.compiler.degree = False
        self.spec.compiler.autolimits = False
        self.spec.option.gravity = hidden.base_tilt.gravity(installation.arm.gravity_m_s2)
        self._grow(self.spec.worldbody, tree.root, None)
        for sensor in installation.wrench_sensor:
            for kind, quantity in (("f", mujoco.mjtSensor.mjSENS_FORCE), ("n", mujoco.mjtSensor.mjSENS_TORQUE)):
                self.spec.add_sensor(
                    name=f"{sensor.name}/{kind}",
                    type=quantity,
                    objtype=mujoco.mjtObj.mjOBJ_SITE,
                    objname=f"site/{sensor.name}",
                )
        for number, shared in enumerate(hidden.shared_transmission):
            tendon = self.spec.add_tendon(name=f"shared/{number}", armature=shared.inertia_kg_m2)
            tendon.wrap_joint(shared.joint, 1.0)
            tendon.wrap_joint(shared.joint_other, shared.ratio)

    def _check_frames(self) -> None:
        links = self.tree.links
        movable = {j.name: j for j in self.tree.joints.values()}
        for name in self.installation.joint_names:
            if name not in movable:
                raise InputError(self.place, f"has no joint {name!r}", f"it has {', '.join(movable)}")
            if movable[name].kind not in ("revolute", "continuous"):
                raise InputError(
                    f"{self.place}: joint {name}",
                    f"is {movable[name].kind or 'of no type'}",
                    "only revolute joints turn",
                )
        wanted = [("arm.tool_frame", self.installation.arm.tool_frame)]
        wanted += [(f"wrench_sensor {s.name}", s.frame) for s in self.installation.wrench_sensor]
        for table in ("link", "link_change", "inertia_excess", "wall", "push"):
            wanted += [(f"hidden {table}", entry.link) for entry in getattr(self.hidden, table)]
        for who, link in wanted:
            if link not in links:
                raise InputError(self.place, f"has no link {link!r}, which {who} names", f"it has {', '.join(links)}")

    def _true_bodies(self) -> dict[str, UrdfBody]:
        bodies = dict(self.tree.bodies)
        for link in self.hidden.link:
            bodies[link.link] = _from_hidden(link)
        for change in self.hidden.link_change:
            body = bodies.get(change.link)
            if body is None:
                raise InputError(
                    f"hidden link_change {change.link}", "the link has no body to change", "list it as link"
                )
            bodies[change.link] = UrdfBody(
                body.mass * change.mass_factor,
                body.centre + np.array(change.centre_shift_m),
                body.inertia * change.mass_factor * change.inertia_factor,
            )
        return bodies

    def _grow(self, parent: mujoco.MjsBody, link: str, joint: UrdfJoint | None) -> None:
        place = {} if joint is None else {"pos": joint.position, "quat": _quaternion(joint.rotation)}
        inertial = _inertial(self.bodies[link]) if link in self.bodies and self.bodies[link].mass > 0 else {}
        body = parent.add_body(name=link, **place, **inertial)
        if joint is not None and joint.name in self.installation.joint_names:
            body.add_joint(name=joint.name, type=mujoco.mjtJoint.mjJNT_HINGE, axis=joint.axis)
        for sensor in self.installation.wrench_sensor:
            if sensor.frame == link:
                self._mount(body, sensor.name, joint)
        if link == self.installation.arm.tool_frame:
            self._load(body)
        for below in self.tree.children(link):
            self._grow(body, below.child, below)

    def _mount(self, body: mujoco.MjsBody, sensor: str, joint: UrdfJoint | None) -> None:
        body.add_site(name=f"site/{sensor}")
        errors = next((w for w in self.hidden.wrench_sensor if w.sensor == sensor), None)
        if errors is None:
            return
        if errors.compliance and (joint is None or joint.kind != "fixed"):
            raise InputError(
                f"hidden wrench_sensor {sensor}", "a compliant sensor sits on a fixed joint of the URDF",
                "give the sensor's frame a fixed joint to the wrist",
            )  # fmt: skip
        # Slides before hinges: the displacement stays along the mounted sensor's axes.
        for give in sorted(errors.compliance, key=lambda c: len(c.axis)):
            name = f"compliance/{sensor}/{give.axis}"
            kind = mujoco.mjtJoint.mjJNT_SLIDE if give.axis in SLIDE_AXES else mujoco.mjtJoint.mjJNT_HINGE
            body.add_joint(name=name, type=kind, axis=SENSOR_AXES[give.axis])
            self.loose.append((name, give.stiffness, give.damping))

    def _load(self, tool: mujoco.MjsBody) -> None:
        payload, sloshing = self.hidden.payload, self.hidden.sloshing_load
        if payload is not None:
            tool.add_body(name="payload", **_inertial(_from_hidden(payload)))
        if sloshing is not None:
            moment = 0.4 * sloshing.mass_kg * sloshing.radius_m**2
            ball = tool.add_body(
                name="sloshing",
                pos=sloshing.centre_m,
                **_inertial(UrdfBody(sloshing.mass_kg, np.zeros(3), moment * np.eye(3))),
            )
            stiffness = sloshing.mass_kg * (2 * math.pi * sloshing.frequency_hz) ** 2
            for axis in ("x", "y"):
                name = f"sloshing/{axis}"
                ball.add_joint(name=name, type=mujoco.mjtJoint.mjJNT_SLIDE, axis=SLIDE_AXES[axis])
                self.loose.append((name, stiffness, sloshing.damping))


def _from_hidden(body: RigidBody) -> UrdfBody:
    return UrdfBody(body.mass_kg, np.array(body.centre_m), inertia_matrix(body.inertia_kg_m2))


def _inertial(body: UrdfBody) -> dict[str, object]:
    i = body.inertia
    full = [i[0, 0], i[1, 1], i[2, 2], i[0, 1], i[0, 2], i[1, 2]]
    return {"mass": body.mass, "ipos": body.centre, "fullinertia": full, "explicitinertial": True}


def _quaternion(rotation: np.ndarray) -> np.ndarray:
    quaternion = np.empty(4)
    mujoco.mju_mat2Quat(quaternion, np.ascontiguousarray(rotation).ravel())
    return quaternion
