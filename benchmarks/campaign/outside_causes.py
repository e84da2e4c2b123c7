"""Causes that the catalogue has no name for. The right answer is ``unknown``, with a signature."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm
from benchmarks.campaign.cause import Cause, Draw, Tables, limit_nm, named, top_speed

NONE: frozenset[tuple[str, str | None]] = frozenset()


def square_law_drag(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """Air or churned grease: d·|dq|·dq."""
    unit = limit_nm(arm, joint) / top_speed(arm, joint) ** 2
    return Cause(
        "square_law_drag",
        NONE,
        lambda a: {"friction": [{"joint": joint, "level_nm": 0.0, "drag_nms2_rad2": a}]},
        unit,
        30 * unit,
    )


def hysteretic_spring(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """A dress pack with memory (Bouc–Wen)."""
    width = float(rng.uniform(0.15, 0.4))
    return Cause(
        "hysteretic_spring",
        NONE,
        lambda a: {
            "cable": [{"joint": joint, "stiffness_nm_rad": a, "elastic_share": 0.1, "yield_rad": width}],
        },
        3 * limit_nm(arm, joint),
        60 * limit_nm(arm, joint),
    )


def gear_beat(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    """Two joints' gears on one shaft: a torque that follows a sum of their angles."""
    k = arm.joints.index(joint)
    if k + 1 == len(arm.joints):
        return None
    other = arm.joints[k + 1]
    orders, phase = rng.uniform(3.0, 6.0, 2), float(rng.uniform(-np.pi, np.pi))
    # Each joint feels it in the measure of its own strength.
    ratio = limit_nm(arm, other) / limit_nm(arm, joint)
    return Cause(
        "gear_beat",
        NONE,
        lambda a: {
            "gear_mesh": [
                {
                    "joint": joint,
                    "joint_other": other,
                    "order": float(orders[0]),
                    "order_other": -float(orders[1]),
                    "amplitude_nm": a,
                    "phase_rad": phase,
                    "ratio": ratio,
                }
            ]
        },
        limit_nm(arm, joint),
        10 * limit_nm(arm, joint),
    )


def rough_place(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """Friction that lives in one stretch of the joint's range."""
    home = arm.installation.arm.home_rad[arm.joints.index(joint)]
    place = {"centre_rad": float(home + rng.uniform(-0.4, 0.4)), "width_rad": float(rng.uniform(0.1, 0.25))}
    return Cause(
        "rough_place",
        NONE,
        lambda a: {
            "friction": [
                {
                    "joint": joint,
                    "level_nm": 0.02 * a,
                    "presliding_rad": 3e-4,
                    "rough_place": [place | {"increase": 49.0}],
                }
            ]
        },
        2 * limit_nm(arm, joint),
        15 * limit_nm(arm, joint),
    )


def sloshing(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    """A load that swings: no rigid body, though a load."""
    if joint != arm.joints[-1]:
        return None
    frequency, centre, radius = float(rng.uniform(1.5, 3.0)), [0.0, 0.0, 0.08], 0.04

    def still(a: float) -> Tables:
        moment = 0.4 * a * radius**2
        return {"payload": {"mass_kg": a, "centre_m": centre, "inertia_kg_m2": [moment, 0, 0, moment, 0, moment]}}

    return Cause(
        "sloshing_load",
        NONE,
        lambda a: {
            "sloshing_load": {
                "mass_kg": a,
                "centre_m": centre,
                "frequency_hz": frequency,
                "damping": 0.03,
                "radius_m": radius,
            }
        },
        0.5,
        4.0,
        excused=named("payload", None) | named("link_inertia", joint, arm.link_of(joint), None),
        known=still,
    )


OUTSIDE: dict[str, Draw] = {
    "square_law_drag": square_law_drag,
    "hysteretic_spring": hysteretic_spring,
    "gear_beat": gear_beat,
    "rough_place": rough_place,
    "sloshing_load": sloshing,
}
