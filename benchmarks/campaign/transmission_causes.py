"""What lies between motor and link, by the names of the catalogue: inertia, springs, gaps, periodic torques."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm
from benchmarks.campaign.cause import Cause, Draw, limit_nm, named, top_speed


def rotor(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    body = arm.bodies[arm.link_of(joint)]
    own = float(body.inertia[2, 2] + body.mass * (body.centre[0] ** 2 + body.centre[1] ** 2))
    answers = named("rotor_inertia", joint)
    # Of the first link nothing acts but its inertia about the axis, as of a rotor there.
    answers |= named("link_inertia", joint) if joint == arm.joints[0] else frozenset()
    return Cause(
        "rotor_inertia",
        answers,
        lambda a: {"rotor_inertia": [{"joint": joint, "inertia_kg_m2": a}]},
        0.3 * own,
        10 * own,
        lambda a: {"inertia": a},
    )


def spring(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    home = arm.installation.arm.home_rad[arm.joints.index(joint)]
    centre = float(home + rng.uniform(-0.8, 0.8))
    return Cause(
        "joint_spring",
        named("joint_spring", joint),
        lambda a: {"joint_spring": [{"joint": joint, "stiffness_nm_rad": a, "centre_rad": centre}]},
        limit_nm(arm, joint),
        6 * limit_nm(arm, joint),
        lambda a: {"stiffness": a, "centre": centre},
    )


def gas_counterbalance(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """A gas cylinder that carries a part of the weight: a spring whose stiffness changes on the way."""
    home = arm.installation.arm.home_rad[arm.joints.index(joint)]
    aligned = float(home + rng.uniform(-0.5, 0.5))
    return Cause(
        "joint_spring:gas",
        named("joint_spring", joint),
        lambda a: {
            "counterbalance": [
                {
                    "joint": joint,
                    "anchor_m": 0.14,
                    "rod_m": 0.1,
                    "aligned_rad": aligned,
                    "preload_n": a,
                    "gas_travel_m": 0.26,
                }
            ]
        },
        20 * limit_nm(arm, joint),
        150 * limit_nm(arm, joint),
    )


def elasticity(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    inertia = _rotor_of(arm, joint)
    if inertia is None:
        return None
    start, least = (1.0 / (inertia * (2 * np.pi * resonance) ** 2) for resonance in (12.0, 80.0))
    return Cause(
        "joint_elasticity",
        named("joint_elasticity", joint),
        lambda a: {
            "rotor_inertia": [{"joint": joint, "inertia_kg_m2": inertia}],
            "elasticity": [
                {"joint": joint, "stiffness_nm_rad": 1.0 / a, "damping_nms_rad": 0.06 * np.sqrt(inertia / a)}
            ],
        },
        start,
        9 * start,
        lambda a: {"stiffness": 1.0 / a},
        taken_from_link={joint: inertia},
        least=least,
    )


def backlash(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    inertia = _rotor_of(arm, joint)
    if inertia is None:
        return None
    stiffness = inertia * (2 * np.pi * 35.0) ** 2
    return Cause(
        "backlash",
        named("backlash", joint),
        lambda a: {
            "rotor_inertia": [{"joint": joint, "inertia_kg_m2": inertia}],
            "elasticity": [
                {
                    "joint": joint,
                    "stiffness_nm_rad": stiffness,
                    "damping_nms_rad": 0.1 * np.sqrt(inertia * stiffness),
                    "gap_rad": a,
                }
            ],
        },
        0.004,
        0.06,
        lambda a: {"gap": a},
        excused=named("joint_elasticity", joint),
        taken_from_link={joint: inertia},
    )


def cogging(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    order, phase = float(rng.integers(4, 25)), float(rng.uniform(-np.pi, np.pi))
    return Cause(
        "cogging",
        named("cogging", joint),
        lambda a: {"cogging": [{"joint": joint, "order": order, "amplitude_nm": a, "phase_rad": phase}]},
        limit_nm(arm, joint),
        6 * limit_nm(arm, joint),
        lambda a: {"order": order, "amplitude": a},
    )


def pulleys(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """Two pulleys out of round on one belt: orders whose ratio is no fraction."""
    first, phases = float(rng.uniform(1.7, 3.0)), rng.uniform(-np.pi, np.pi, 2)
    orders = (first, first * np.sqrt(5.0) / 1.3)
    return Cause(
        "cogging:pulleys",
        named("cogging", joint),
        lambda a: {
            "cogging": [
                {"joint": joint, "order": order, "amplitude_nm": a, "phase_rad": float(phase)}
                for order, phase in zip(orders, phases, strict=True)
            ]
        },
        limit_nm(arm, joint),
        10 * limit_nm(arm, joint),
    )


def wave_generator(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """A harmonic drive's: two waves a turn of what turns its flexspline, which turns 50 to 120 times as often as the
    joint."""
    order, phase = 2.0 * float(rng.integers(50, 121)), float(rng.uniform(-np.pi, np.pi))
    return Cause(
        "cogging:wave_generator",
        named("cogging", joint),
        lambda a: {"cogging": [{"joint": joint, "order": order, "amplitude_nm": a, "phase_rad": phase}]},
        limit_nm(arm, joint),
        40 * limit_nm(arm, joint),
        lambda a: {"order": order, "amplitude": a},
    )


def ripple(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    order, phase = float(rng.integers(4, 25)), float(rng.uniform(-np.pi, np.pi))
    return Cause(
        "torque_ripple",
        named("torque_ripple", joint),
        lambda a: {"torque_ripple": [{"joint": joint, "order": order, "amplitude": a, "phase_rad": phase}]},
        0.03,
        0.3,
        lambda a: {"order": order, "amplitude": a},
    )


def coupling(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    k = arm.joints.index(joint)
    if k + 1 == len(arm.joints):
        return None
    other, ratio = arm.joints[k + 1], float(rng.choice([-1.0, -0.6, 0.6, 1.0]))
    unit = min(limit_nm(arm, joint) / top_speed(arm, joint), limit_nm(arm, other) / top_speed(arm, other))
    return Cause(
        "transmission_coupling",
        named("transmission_coupling", joint, other),
        lambda a: {
            "shared_transmission": [
                {"joint": joint, "joint_other": other, "ratio": ratio, "viscous_nms_rad": a, "level_nm": 0.0}
            ]
        },
        unit,
        10 * unit,
    )


def shared_rotor(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    """A motor behind a wrist that two joints turn."""
    k = arm.joints.index(joint)
    if k + 1 == len(arm.joints):
        return None
    other, ratio = arm.joints[k + 1], float(rng.choice([-1.0, -0.6, 0.6, 1.0]))
    rotor = {"joint": joint, "joint_other": other, "ratio": ratio}
    unit = 0.1 * limit_nm(arm, other) / top_speed(arm, other)
    return Cause(
        "transmission_coupling:rotor",
        named("transmission_coupling", joint, other),
        lambda a: {"shared_transmission": [{**rotor, "inertia_kg_m2": a}]},
        unit,
        100 * unit,
        lambda a: {"inertia": a, "ratio": ratio},
    )


def _rotor_of(arm: TrueArm, joint: str) -> float | None:
    """The share of the link's moment about its axis that an elastic joint has on the motor's side, kg·m².

    Of the first two joints only: no other joint turns their rotors about the rotors' own axes, so the stiff limit of
    the elastic arm is the rigid one exactly.
    """
    if joint not in arm.joints[:2]:
        return None
    known = next((r.inertia_kg_m2 for r in arm.noise.rotor_inertia if r.joint == joint), None)
    return known if known is not None else 0.4 * float(arm.bodies[arm.link_of(joint)].inertia[2, 2])


TRANSMISSION: dict[str, Draw] = {
    "rotor_inertia": rotor,
    "joint_spring": spring,
    "joint_spring:gas": gas_counterbalance,
    "joint_elasticity": elasticity,
    "backlash": backlash,
    "cogging": cogging,
    "cogging:pulleys": pulleys,
    "torque_ripple": ripple,
    "transmission_coupling": coupling,
    "transmission_coupling:rotor": shared_rotor,
}
FINE_LINES: dict[str, Draw] = {"cogging:wave_generator": wave_generator}
