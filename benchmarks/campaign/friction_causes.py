"""Friction by the names of the catalogue, as bristles that bend, slip, wear in and carry load."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator
from numpy.typing import NDArray

from benchmarks.campaign.arms import TrueArm
from benchmarks.campaign.cause import Cause, Draw, Named, Tables, limit_nm, named, top_speed

EVERYWHERE = ("coulomb_friction", "viscous_friction", "presliding")
"""What friction of every joint may rightly be called."""


def everywhere(arm: TrueArm, level: NDArray[np.float64], rng: Generator) -> tuple[Tables, frozenset[Named]]:
    """Friction of every joint, as all arms have it: dry, about ``level`` (joints,) N·m, and as much viscous at half the
    top speed; with the names that are right for it."""
    entries = []
    for joint, about in zip(arm.joints, level, strict=True):
        dry, viscous = (float(about * rng.uniform(0.6, 1.5)) for _ in range(2))
        entries.append(
            {
                "joint": joint,
                "level_nm": dry,
                "viscous_nms_rad": 2.0 * viscous / top_speed(arm, joint),
                "presliding_rad": float(10.0 ** rng.uniform(-4.7, -3.7)),
            }
        )
    return {"friction": entries}, frozenset().union(*(named(name, *arm.joints) for name in EVERYWHERE))


def viscous(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    unit = limit_nm(arm, joint) / top_speed(arm, joint)
    return Cause(
        "viscous_friction",
        named("viscous_friction", joint),
        lambda a: {"friction": [{"joint": joint, "level_nm": 0.0, "viscous_nms_rad": a}]},
        unit,
        10 * unit,
        lambda a: {"coefficient": a},
    )


def degressive(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """Grease that thins as it is sheared: a power of the speed, beside the gear's dry friction."""
    at_top, dry = limit_nm(arm, joint), float(rng.uniform(0.2, 0.6))
    exponent = float(rng.uniform(0.5, 0.75))
    scale = float(top_speed(arm, joint) ** exponent)
    return Cause(
        "viscous_friction:degressive",
        named("viscous_friction", joint),
        lambda a: {
            "friction": [
                {
                    "joint": joint,
                    "level_nm": dry * a,
                    "viscous_nms_rad": a / scale,
                    "viscous_exponent": exponent,
                    "presliding_rad": 5e-5,
                }
            ]
        },
        at_top,
        10 * at_top,
        excused=named("coulomb_friction", joint) | named("presliding", joint),
    )


def coulomb(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    give = float(10.0 ** rng.uniform(-4.7, -3.7))
    return Cause(
        "coulomb_friction",
        # Bristles are the truth, so who sees them bend is right too.
        named("coulomb_friction", joint) | named("presliding", joint),
        lambda a: {"friction": [{"joint": joint, "level_nm": a, "presliding_rad": give}]},
        limit_nm(arm, joint),
        8 * limit_nm(arm, joint),
        lambda a: {"level": a},
    )


def asymmetric(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    other, viscous_share = float(rng.choice([0.4, 0.55, 1.6, 2.2])), float(rng.uniform(0.2, 0.6))
    slope = viscous_share / top_speed(arm, joint)
    return Cause(
        "asymmetric_friction",
        named("asymmetric_friction", joint),
        lambda a: {
            "friction": [
                {
                    "joint": joint,
                    "level_nm": a,
                    "level_negative_nm": other * a,
                    "viscous_nms_rad": slope * a,
                    "viscous_negative_nms_rad": slope * a / other,
                    "presliding_rad": 5e-5,
                }
            ]
        },
        limit_nm(arm, joint),
        8 * limit_nm(arm, joint),
        lambda a: {"level_positive": a, "level_negative": other * a},
    )


def stribeck(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    factor, exponent = float(rng.uniform(1.7, 2.6)), float(rng.uniform(0.8, 1.8))
    velocity = float(rng.uniform(0.03, 0.12)) * top_speed(arm, joint)
    slope = float(rng.uniform(0.0, 0.5)) / top_speed(arm, joint)
    return Cause(
        "stribeck_friction",
        named("stribeck_friction", joint),
        lambda a: {
            "friction": [
                {
                    "joint": joint,
                    "level_nm": a,
                    "breakaway_factor": factor,
                    "stribeck_exponent": exponent,
                    "stribeck_velocity_rad_s": velocity,
                    "viscous_nms_rad": slope * a,
                    "presliding_rad": 5e-5,
                }
            ]
        },
        limit_nm(arm, joint),
        6 * limit_nm(arm, joint),
        lambda a: {"level": a},
    )


def load_dependent(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """What the servo's answer to its counts presses the gear with, whatever the load, is a Coulomb friction."""
    return Cause(
        "load_dependent_friction",
        named("load_dependent_friction", joint),
        lambda a: {"friction": [{"joint": joint, "level_nm": 0.0, "load_coefficient": a, "presliding_rad": 5e-5}]},
        0.05,
        0.3,
        lambda a: {"coefficient": a},
        excused=named("coulomb_friction", joint),
    )


def presliding(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    give = float(rng.uniform(0.03, 0.1))
    return Cause(
        "presliding",
        named("presliding", joint),
        lambda a: {
            "friction": [{"joint": joint, "level_nm": a, "presliding_rad": give, "bristle_damping_nms_rad": 0.0}]
        },
        limit_nm(arm, joint),
        8 * limit_nm(arm, joint),
        lambda a: {"level": a, "stiffness": a / give},
    )


def drifting(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    initial, time = float(rng.choice([0.2, 2.5, 3.5])), float(rng.uniform(10.0, 40.0))
    return Cause(
        "friction_drift",
        named("friction_drift", joint),
        lambda a: {
            "friction": [
                {
                    "joint": joint,
                    "level_nm": a,
                    "presliding_rad": 5e-5,
                    "running_in": {"initial_factor": initial, "time_constant_s": time},
                }
            ]
        },
        limit_nm(arm, joint),
        4 * limit_nm(arm, joint),
        lambda a: {"final": a},
    )


FRICTION: dict[str, Draw] = {
    "viscous_friction": viscous,
    "coulomb_friction": coulomb,
    "asymmetric_friction": asymmetric,
    "stribeck_friction": stribeck,
    "load_dependent_friction": load_dependent,
    "presliding": presliding,
    "friction_drift": drifting,
}
DEGRESSIVE: dict[str, Draw] = {"viscous_friction:degressive": degressive}
