"""What torque and angle sensors get wrong, by the names of the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm
from benchmarks.campaign.cause import Cause, Draw, limit_nm, named


def torque_constant(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    sign = float(rng.choice([-1.0, 1.0]))
    return Cause(
        "torque_constant_error",
        named("torque_constant_error", joint),
        lambda a: {"motor": [{"joint": joint, "gain": 1.0 + sign * a}]},
        0.08,
        0.4,
        lambda a: {"gain": 1.0 + sign * a},
    )


def torque_nonlinearity(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    return Cause(
        "torque_nonlinearity",
        named("torque_nonlinearity", joint),
        lambda a: {"motor": [{"joint": joint, "dead_zone_nm": a}]},
        limit_nm(arm, joint),
        6 * limit_nm(arm, joint),
        lambda a: {"dead_zone": a},
    )


def torque_offset(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    sign = float(rng.choice([-1.0, 1.0]))
    return Cause(
        "torque_offset",
        named("torque_offset", joint),
        lambda a: {"torque_sensor": [{"joint": joint, "offset_nm": sign * a}]},
        limit_nm(arm, joint),
        6 * limit_nm(arm, joint),
        lambda a: {"offset": sign * a},
    )


def late_torque(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    return Cause(
        "transport_delay:torque",
        named("transport_delay", joint, None),
        lambda a: {"torque_sensor": [{"joint": joint, "delay_s": a}]},
        0.006,
        0.04,
        lambda a: {"delay": a},
    )


def late_angle(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    """As of an encoder that is asked over a line of its own. The servo closes its loop over it too."""
    return Cause(
        "transport_delay:angle",
        named("transport_delay", joint),
        lambda a: {"angle_sensor": [{"joint": joint, "delay_s": a}]},
        0.001,
        0.015,
        lambda a: {"delay": a},
    )


def encoder_offset(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    sign = float(rng.choice([-1.0, 1.0]))
    return Cause(
        "encoder_offset",
        named("encoder_offset", joint),
        lambda a: {"angle_sensor": [{"joint": joint, "offset_rad": sign * a}]},
        0.02,
        0.15,
        lambda a: {"offset": sign * a},
    )


def eccentricity(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    phase = float(rng.uniform(-np.pi, np.pi))
    return Cause(
        "encoder_eccentricity",
        named("encoder_eccentricity", joint),
        lambda a: {"angle_sensor": [{"joint": joint, "eccentricity_rad": a, "eccentricity_phase_rad": phase}]},
        0.01,
        0.1,
        lambda a: {"amplitude": a},
    )


SENSORS: dict[str, Draw] = {
    "torque_constant_error": torque_constant,
    "torque_nonlinearity": torque_nonlinearity,
    "torque_offset": torque_offset,
    "transport_delay": late_torque,
    "encoder_offset": encoder_offset,
    "encoder_eccentricity": eccentricity,
}
LATE_ANGLES: dict[str, Draw] = {"transport_delay:angle": late_angle}
