"""Bodies, and what they touch, by the names of the catalogue."""

from __future__ import annotations

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import TrueArm
from benchmarks.campaign.cause import Cause, Draw, Tables, named

BEYOND_TOLERANCE = 0.15
"""Of a link's mass: three times the finder's tolerance, within which a link that is off is none."""


def link_inertia(arm: TrueArm, joint: str, rng: Generator) -> Cause:
    link = arm.link_of(joint)
    shift = rng.standard_normal(3)
    shift *= 0.05 / np.linalg.norm(shift)
    body = arm.bodies[link]

    def tables(a: float) -> Tables:
        # The load that an adapter or a cable clamp is: mass that the drawing does not have, off the drawn centre.
        return {
            "link_change": [{"link": link, "mass_factor": 1.0 + a, "centre_shift_m": (a / (1.0 + a) * shift).tolist()}]
        }

    answers = named("link_inertia", joint, link, None)
    # A body on the last link and a load at the tool are one and the same thing.
    answers |= named("payload", None) if joint == arm.joints[-1] else frozenset()
    # Of the first link nothing acts but its inertia about the axis, as of a rotor there.
    answers |= named("rotor_inertia", joint) if joint == arm.joints[0] else frozenset()
    return Cause("link_inertia", answers, tables, 0.5, 4.0 if body.mass > 0.0 else 0.0, least=BEYOND_TOLERANCE)


def payload(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    if joint != arm.joints[-1]:
        return None
    centre = [*rng.uniform(-0.03, 0.03, 2).tolist(), float(rng.uniform(0.02, 0.1))]
    last = arm.link_of(joint)
    return Cause(
        "payload",
        named("payload", None) | named("link_inertia", joint, last, None),
        lambda a: {
            "payload": {"mass_kg": a, "centre_m": centre, "inertia_kg_m2": [2e-3 * a, 0, 0, 2e-3 * a, 0, 2e-3 * a]}
        },
        0.3,
        6.0,
        lambda a: {"mass": a},
    )


def base_tilt(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    if joint != arm.joints[0]:
        return None
    direction = float(rng.uniform(-np.pi, np.pi))
    return Cause(
        "base_tilt",
        named("base_tilt", None),
        lambda a: {"base_tilt": {"roll_rad": a * np.cos(direction), "pitch_rad": a * np.sin(direction)}},
        0.02,
        0.3,
        lambda a: {"roll": float(a * np.cos(direction)), "pitch": float(a * np.sin(direction))},
    )


def contact(arm: TrueArm, joint: str, rng: Generator) -> Cause | None:
    """A wall some way out from home, on the last link's way."""
    if joint != arm.joints[0]:
        return None
    last, yaw = arm.link_of(arm.joints[-1]), float(rng.uniform(-np.pi, np.pi))
    inwards = np.array([np.cos(yaw), np.sin(yaw), 0.0])
    point = arm.place_at_home(last) - 0.1 * inwards
    return Cause(
        "contact",
        named("contact", None, *arm.joints),
        lambda a: {"wall": [{"link": last, "point_m": point.tolist(), "normal": inwards.tolist(), "stiffness_n_m": a}]},
        20.0,
        2000.0,
    )


BODIES: dict[str, Draw] = {
    "link_inertia": link_inertia,
    "payload": payload,
    "base_tilt": base_tilt,
    "contact": contact,
}
