"""From the installation and its hidden mechanics to the parts of a plant, at rest at home."""

from __future__ import annotations

import math
from collections.abc import Iterable
from dataclasses import dataclass
from typing import Protocol, TypeVar

import mujoco

from config import InputError, Installation
from config.schema import Joint
from virtual_hw.hidden.bodies import Payload
from virtual_hw.hidden.friction import BristleFriction, Friction
from virtual_hw.hidden.joint_sensors import AngleSensor, TorqueSensor, VelocitySensor
from virtual_hw.hidden.mechanics import HiddenMechanics
from virtual_hw.hidden.motor import Motor, MotorState
from virtual_hw.hidden.noise import SILENT, Noise
from virtual_hw.hidden.periodic import Harmonics
from virtual_hw.hidden.transmission import TwoMassSpring
from virtual_hw.plant.joint import DriveTrain
from virtual_hw.plant.multibody import Multibody, build_multibody
from virtual_hw.plant.outside import OutsideForces
from virtual_hw.plant.pair import MeshBeat, SharedShaft
from virtual_hw.plant.sensing import JointSensors

NOISE_CHANNELS = 6
"""A joint's noise: angle, velocity, torque, three phase currents."""
BRAKE_GIVE_RAD = 2e-5
"""What a brake turns by at its holding torque."""
STEP_LIMIT = 1.5
"""Largest ω·h of a free spring; the integrator's bound of stability is 2."""


class OfJoint(Protocol):
    @property
    def joint(self) -> str: ...


Law = TypeVar("Law", bound=OfJoint)


@dataclass
class PlantParts:
    """What `Plant` runs; lists have one entry a joint."""

    tick_ns: int
    substeps: int
    multibody: Multibody
    trains: list[DriveTrain]
    sensors: list[JointSensors]
    motors: list[Motor]
    encoder_on_link: list[bool]
    noise: list[Noise]
    armature: list[float]
    shafts: list[SharedShaft]
    beats: list[MeshBeat]
    outside: OutsideForces
    timed_payload: Payload | None


def assemble(installation: Installation, hidden: HiddenMechanics) -> PlantParts:
    """Build every part. Raises InputError where the hidden mechanics cannot be this arm's, or cannot be integrated."""
    tick_ns = hidden.tick_us * 1000
    if installation.cycle.period_ns % tick_ns:
        raise InputError(
            f"{installation.path}: cycle.rate_hz",
            f"its {installation.cycle.period_ns / 1e3:g} µs are no multiple of the servo tick, {hidden.tick_us} µs",
            "choose tick_us of the hidden mechanics to divide the period",
        )
    body = build_multibody(installation, hidden)
    step_s = tick_ns * 1e-9 / hidden.substeps
    for dof, angle in zip(body.dof, installation.arm.home_rad, strict=True):
        body.data.qpos[dof] = angle
    armature = [0.0] * body.model.nv
    for rotor in hidden.rotor_inertia:
        if _of(hidden.elasticity, rotor.joint) is None:
            armature[body.dof[installation.joint_names.index(rotor.joint)]] = rotor.inertia_kg_m2
    _settle_loose(body, step_s)

    names = installation.joint_names
    dof_of = dict(zip(names, body.dof, strict=True))
    beats = [MeshBeat(law, dof_of[law.joint], dof_of[law.joint_other]) for law in hidden.gear_mesh]
    needed = body.data.qfrc_bias.tolist()
    against = [0.0] * body.model.nv
    for beat in beats:
        beat.load(body.data.qpos.tolist(), against)
    trains = []
    for joint, dof in zip(installation.joint, body.dof, strict=True):
        train = _train(joint, hidden, tick_ns * 1e-9, step_s, float(body.data.qpos[dof]))
        train.rest(float(body.data.qpos[dof]), needed[dof] - against[dof])
        trains.append(train)
    return PlantParts(
        tick_ns=tick_ns,
        substeps=hidden.substeps,
        multibody=body,
        trains=trains,
        sensors=[_sensors(installation, j, hidden, t) for j, t in zip(installation.joint, trains, strict=True)],
        motors=[_of(hidden.motor, j) or Motor(joint=j) for j in names],
        encoder_on_link=[(e := _of(hidden.elasticity, j)) is not None and e.encoder == "link" for j in names],
        noise=[channel for j in names for channel in _noise(hidden, j)],
        armature=armature,
        shafts=[
            SharedShaft(
                law, dof_of[law.joint], dof_of[law.joint_other], body.model, body.model.tendon(f"shared/{number}").id
            )
            for number, law in enumerate(hidden.shared_transmission)
        ],
        beats=beats,
        outside=OutsideForces(hidden, body.model, body.data),
        timed_payload=hidden.payload if hidden.payload and (hidden.payload.from_s or hidden.payload.until_s) else None,
    )


def _of(laws: Iterable[Law], joint: str) -> Law | None:
    return next((law for law in laws if law.joint == joint), None)


def _settle_loose(body: Multibody, step_s: float) -> None:
    """Let the parts on springs hang at rest, give them their damping, and refuse springs the step cannot follow."""
    model, data = body.model, body.data
    for _ in range(50):
        mujoco.mj_forward(model, data)
        for dof, stiffness, _ in body.loose:
            data.qpos[dof] -= (data.qfrc_bias[dof] + stiffness * data.qpos[dof]) / stiffness
    mujoco.mj_forward(model, data)
    for dof, stiffness, ratio in body.loose:
        # Inertia that the spring feels with the other springs free: 1 / (M⁻¹)_dd.
        unit, answer = [0.0] * model.nv, data.qacc.copy()
        unit[dof] = 1.0
        mujoco.mj_solveM(model, data, answer.reshape(1, -1), [unit])
        inertia = 1.0 / float(answer[dof])
        omega = math.sqrt(stiffness / inertia)
        if omega * step_s > STEP_LIMIT:
            name = model.joint(int(model.dof_jntid[dof])).name
            raise InputError(
                f"hidden mechanics: {name}", f"swings at {omega / 2 / math.pi:.0f} Hz, too fast for the step",
                "lower its stiffness or raise substeps",
            )  # fmt: skip
        model.dof_damping[dof] = 2.0 * ratio * math.sqrt(stiffness * inertia)


def _train(joint: Joint, hidden: HiddenMechanics, tick_s: float, step_s: float, angle: float) -> DriveTrain:
    name = joint.name
    motor = _of(hidden.motor, name) or Motor(joint=name)
    ripple = Harmonics((r.order, r.amplitude, r.phase_rad) for r in hidden.torque_ripple if r.joint == name)
    cogging = Harmonics((c.order, c.amplitude_nm, c.phase_rad) for c in hidden.cogging if c.joint == name)
    friction, elasticity = _of(hidden.friction, name), _of(hidden.elasticity, name)
    rotor = _of(hidden.rotor_inertia, name)
    inertia = rotor.inertia_kg_m2 if rotor else 0.0
    if elasticity is not None and math.sqrt(elasticity.stiffness_nm_rad / inertia) * step_s > STEP_LIMIT:
        raise InputError(
            f"hidden mechanics: elasticity of {name}", "the rotor swings too fast on the spring for the step",
            "lower stiffness_nm_rad, or raise the rotor inertia or substeps",
        )  # fmt: skip
    holding = motor.brake_torque_nm or 3.0 * joint.limits.torque_nm
    laws = [
        law.law()
        for table in (hidden.joint_spring, hidden.counterbalance, hidden.cable)
        for law in table
        if law.joint == name
    ]
    return DriveTrain(
        motor=MotorState(motor, ripple, joint.limits.torque_nm, tick_s),
        friction=BristleFriction(friction) if friction else None,
        brake=BristleFriction(Friction(joint=name, level_nm=holding, presliding_rad=BRAKE_GIVE_RAD)),
        cogging=cogging,
        laws=laws,
        spring=TwoMassSpring(elasticity) if elasticity else None,
        rotor_inertia=inertia,
        angle=angle,
    )


def _sensors(installation: Installation, joint: Joint, hidden: HiddenMechanics, train: DriveTrain) -> JointSensors:
    layouts = installation.drive_of(joint).layouts.values()
    tachometer = any("velocity" in pdo for layout in layouts for pdo in layout.tpdo)
    elasticity = _of(hidden.elasticity, joint.name)
    home = installation.arm.home_rad[installation.joint_names.index(joint.name)]
    return JointSensors(
        joint.encoder,
        _of(hidden.angle_sensor, joint.name) or AngleSensor(joint=joint.name),
        _of(hidden.velocity_sensor, joint.name) or VelocitySensor(joint=joint.name),
        _of(hidden.torque_sensor, joint.name) or TorqueSensor(joint=joint.name),
        tachometer,
        hidden.tick_us * 1e-6,
        home if elasticity is not None and elasticity.encoder == "link" else train.angle,
    )


def _noise(hidden: HiddenMechanics, joint: str) -> tuple[Noise, ...]:
    angle, velocity = _of(hidden.angle_sensor, joint), _of(hidden.velocity_sensor, joint)
    torque, motor = _of(hidden.torque_sensor, joint), _of(hidden.motor, joint)
    phase = Noise(white=motor.phase_noise_a) if motor else SILENT
    return (*(sensor.noise if sensor else SILENT for sensor in (angle, velocity, torque)), phase, phase, phase)
