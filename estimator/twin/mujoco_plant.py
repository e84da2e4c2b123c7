"""A plant as MuJoCo has it: one tree of bodies, from which both the simulation and the MJCF export are made."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import mujoco
import numpy as np
import pinocchio as pin
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import base_parameters
from estimator.consistency import is_consistent, nearest_consistent
from estimator.parallel_axis import about_centre
from estimator.twin.plant import PlantDraft, Series

Array = NDArray[np.float64]

ROTOR_SHARE = 0.03
"""Inertia of a motor behind an elastic transmission where none is known, as a share of its joint's own."""
LOOSE = 1e-9
"""kg and kg·m², the least a moving body has."""
HARD = (0.9999, 0.9999, 1e-3, 0.5, 2.0)
"""MuJoCo's ``solimp`` of a constraint that does not give."""
RELATIVE_ERROR = 1e-3
"""How exactly bodies should have the model's base parameters where no bodies can have them quite."""


def plant_spec(draft: PlantDraft) -> Any:
    """The plant as an `mujoco.MjSpec`, with all that MuJoCo has elements for.

    Joints keep their names; behind the motor of joint j with an elastic transmission or a gap lies a joint named
    "j transmission". Raises InputError when a body cannot be simulated.
    """
    spec = mujoco.MjSpec()
    spec.modelname = "etude"
    spec.compiler.degree = False
    spec.compiler.boundmass = spec.compiler.boundinertia = LOOSE
    spec.option.gravity = draft.gravity
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    links: list[Any] = []
    own = inertia_about_joints(draft)
    bodies = possible_bodies(PlantDraft(draft.body, without_motors(draft, own)))
    for k, (axis, values) in enumerate(zip(draft.body.axes, bodies.reshape(-1, 10), strict=True)):
        parent = links[axis.parent] if axis.parent >= 0 else spec.worldbody
        link = parent.add_body(name=f"link of {axis.name}", pos=axis.translation, quat=_quaternion(axis.rotation))
        joint = _add_joint(link, draft, k, axis.name)
        if k in draft.series:
            link.name = f"motor of {axis.name}"
            joint.armature = joint.armature + draft.series[k].motor_share * own[k] or ROTOR_SHARE * own[k]
            link = link.add_body(name=f"link of {axis.name}")
            _add_transmission(link, draft, k, draft.series[k])
        _set_inertial(link, values)
        links.append(link)
        _add_motor(spec, draft, k)
    for frame in draft.body.model.frames:
        # The URDF's other links: tools, sensors, what stands still in the base.
        if frame.type == pin.FrameType.BODY and frame.parentJoint > 0 and not frame.placement.isIdentity(1e-12):
            links[frame.parentJoint - 1].add_site(
                name=frame.name, pos=frame.placement.translation, quat=_quaternion(frame.placement.rotation)
            )
    _add_couplings(spec, draft)
    return spec


@dataclass(frozen=True)
class CompiledPlant:
    """``motor`` and ``link``: the degrees of freedom of each joint on either side of its transmission."""

    model: Any
    motor: NDArray[np.intp]
    link: NDArray[np.intp]
    last_body: int
    lent: Array
    """(n,) kg·m² of the motors that only make them steppable: no part of the model."""


def compile_plant(draft: PlantDraft, timestep: float) -> CompiledPlant:
    """A plant ready to be simulated. Raises InputError when MuJoCo refuses it, or a joint moves no mass."""
    spec = plant_spec(draft)
    spec.option.timestep = timestep
    spec.option.disableflags = mujoco.mjtDisableBit.mjDSBL_CONTACT | mujoco.mjtDisableBit.mjDSBL_ACTUATION
    for joint in spec.joints:
        # Dry friction as hard as the step allows: what sticks creeps by no more than the solver's tolerance.
        joint.solref_friction = [2.0 * timestep, 1.0]
        joint.solimp_friction = HARD
        # The end of a gap, likewise.
        joint.solref_limit = [2.0 * timestep, 1.0]
        joint.solimp_limit = HARD
    model = _compiled(spec)
    names = draft.body.joints
    weightless = [n for n, own in zip(names, inertia_about_joints(draft) + draft.armature, strict=True) if own <= LOOSE]
    if weightless:
        raise InputError(
            "model", f"nothing that joint {weightless[0]} moves has a mass", "give inertial elements, or identify first"
        )
    motor = np.array([model.joint(name).dofadr[0] for name in names])
    shares = np.array([draft.series.get(k, Series()).motor_share for k in range(draft.body.n)])
    lent = model.dof_armature[motor] - draft.gain * draft.armature - shares * inertia_about_joints(draft)
    link = np.array(
        [model.joint(_transmission(n)).dofadr[0] if k in draft.series else motor[k] for k, n in enumerate(names)]
    )
    return CompiledPlant(model, motor, link, model.body(f"link of {names[-1]}").id, lent)


def mjcf_of(draft: PlantDraft) -> str:
    """MJCF text of what MuJoCo has elements for. Raises InputError when MuJoCo refuses it."""
    spec = plant_spec(draft)
    _compiled(spec)
    text: str = spec.to_xml()
    return text


def without_motors(draft: PlantDraft, own: Array) -> Array:
    """(10·n,) the draft's parameters less the motors that are part of its bodies: shares of the joints' ``own``
    inertia (n,)."""
    parameters = draft.parameters.copy()
    for k, series in draft.series.items():
        axis, link = draft.body.axes[k], parameters[10 * k : 10 * k + 10]
        taken = series.motor_share * own[k]
        if axis.revolute:
            about = np.outer(axis.direction, axis.direction)
            link[4:] -= taken * about[np.triu_indices(3)]
        elif taken < link[0]:
            link *= 1.0 - taken / link[0]
    return parameters


def possible_bodies(draft: PlantDraft) -> Array:
    """(10·n,) the draft's inertial parameters, or where no bodies can have them those of bodies with base parameters
    as near as can be. A link without any parameters stays one."""
    links = draft.parameters.reshape(-1, 10)
    empty = ~links.any(axis=1)
    if np.all(is_consistent(draft.parameters) | empty):
        return draft.parameters
    base = base_parameters(draft.body)
    beta = base.combination @ draft.parameters
    error = RELATIVE_ERROR * (np.abs(beta) + 1e-3 * np.abs(beta).max())
    # Links that no body can be are pulled towards balls instead of towards themselves.
    anchors = np.where((links[:, 0] > 0.0)[:, None], links, _ball(max(float(links[:, 0].max()), 1.0)))
    return nearest_consistent(base, beta, np.diag(error**2), anchors.ravel()).parameters


def _ball(mass: float) -> Array:
    """(10,) of a ball of 10 cm about the frame's origin."""
    inertia = 0.4 * mass * 0.1**2
    return np.array([mass, 0.0, 0.0, 0.0, inertia, 0.0, 0.0, inertia, 0.0, inertia])


def inertia_about_joints(draft: PlantDraft) -> Array:
    """(n,) kg·m² of the arm about each joint, in the pose of zeros, the other joints locked."""
    body = draft.body
    matrix = pin.crba(body.model, body.model.createData(), body.configuration(np.zeros(body.n)))
    return np.maximum(np.abs(np.diag(matrix)), LOOSE)


def _compiled(spec: Any) -> Any:
    try:
        return spec.compile()
    except ValueError as error:
        raise InputError("model", f"MuJoCo refuses it ({error})", "look at its link parameters") from None


def _transmission(joint: str) -> str:
    return f"{joint} transmission"


def _kind(draft: PlantDraft, k: int) -> Any:
    return mujoco.mjtJoint.mjJNT_HINGE if draft.body.axes[k].revolute else mujoco.mjtJoint.mjJNT_SLIDE


def _add_joint(link: Any, draft: PlantDraft, k: int, name: str) -> Any:
    # What was fitted is in units of the measured torque; a motor that gives g times as much spends g times as much.
    gain = float(draft.gain[k])
    joint = link.add_joint(name=name, type=_kind(draft, k), axis=draft.body.axes[k].direction)
    _set_linear(joint, "damping", gain * draft.viscous[k])
    _set_linear(joint, "stiffness", gain * draft.stiffness[k])
    joint.springref = draft.centre[k]
    joint.frictionloss = gain * draft.friction[k]
    joint.armature = gain * draft.armature[k]
    return joint


def _add_transmission(link: Any, draft: PlantDraft, k: int, series: Series) -> None:
    name = _transmission(draft.body.joints[k])
    joint = link.add_joint(name=name, type=_kind(draft, k), axis=draft.body.axes[k].direction)
    _set_linear(joint, "stiffness", series.stiffness)
    _set_linear(joint, "damping", series.damping)
    if series.gap > 0.0:
        joint.limited = mujoco.mjtLimited.mjLIMITED_TRUE
        joint.range = [-series.gap / 2.0, series.gap / 2.0]


def _add_motor(spec: Any, draft: PlantDraft, k: int) -> None:
    name, gain = draft.body.joints[k], float(draft.gain[k])
    motor = spec.add_actuator(name=name, target=name, trntype=mujoco.mjtTrn.mjTRN_JOINT)
    motor.gear[0] = gain
    if draft.offset[k]:
        motor.biastype = mujoco.mjtBias.mjBIAS_AFFINE
        motor.biasprm[0] = -draft.offset[k]


def _add_couplings(spec: Any, draft: PlantDraft) -> None:
    for coupling in draft.couplings:
        joint, other = (draft.body.joints[k] for k in (coupling.joint, coupling.other))
        tendon = spec.add_tendon(name=f"{joint} with {other}", frictionloss=coupling.level, armature=coupling.inertia)
        _set_linear(tendon, "damping", coupling.viscous)
        tendon.wrap_joint(joint, 1.0)
        tendon.wrap_joint(other, coupling.ratio)


def _set_linear(element: Any, attribute: str, value: float) -> None:
    """Springs and dampers are polynomials since MuJoCo 4; before, they were numbers."""
    if np.ndim(getattr(element, attribute)):
        getattr(element, attribute)[0] = value
    else:
        setattr(element, attribute, value)


def _set_inertial(link: Any, values: Array) -> None:
    mass, first = float(values[0]), values[1:4]
    if mass <= 0.0:
        return
    xx, xy, xz, yy, yz, zz = about_centre(values)
    link.mass, link.ipos, link.explicitinertial = mass, first / mass, True
    link.fullinertia = [xx, yy, zz, xy, xz, yz]


def _quaternion(rotation: Array) -> Array:
    result = np.zeros(4)
    mujoco.mju_mat2Quat(result, np.asarray(rotation, dtype=float).ravel())
    return result
