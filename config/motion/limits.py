"""A sampled motion held against an installation's limits, and moves that keep within them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.errors import InputError
from config.motion.curves import Array, RestToRest
from config.motion.sampled import SampledMotion
from config.schema import Installation

_SLACK = 1e-9
"""Relative slack of a limit, for the last digit of a motion that just touches it."""
_REST = 1e-3
"""Share of a velocity limit below which a joint counts as at rest at the motion's ends."""
_PEAK_VELOCITY, _PEAK_ACCELERATION = 15 / 8, 10 / 3**0.5
"""Of the unit 5th-order move over unit time."""
_SHORTEST_S = 0.1


@dataclass(frozen=True)
class Excess:
    """The worst sample of a quantity of one joint beyond its limit; ``slower`` is the time scaling that cures it."""

    joint: str
    quantity: str
    unit: str
    value: float
    limit: float
    time_s: float
    slower: float

    def __str__(self) -> str:
        return (
            f"{self.joint}: {self.quantity} {self.value:.4g} {self.unit} at {self.time_s:.3f} s is "
            f"{abs(self.value) - self.limit:.3g} {self.unit} beyond its limit {self.limit:.4g}"
        )


def check_motion(sampled: SampledMotion, installation: Installation, name: str = "motion") -> None:
    """Raise InputError when the motion cannot be played within the limits of ``installation``.

    It names the joint, the quantity, the time and the excess, and for velocity and acceleration the shortest
    duration that fits. Values that are not finite and a motion that does not begin and end at rest are refused too.
    """
    joints = installation.joint_names
    if sampled.q.shape[1] != len(joints):
        raise InputError(name, f"has {sampled.q.shape[1]} joints", f"{installation.arm.name} has {len(joints)}")
    _require_finite(sampled, joints, name)
    _require_position(sampled, installation, name)
    if excesses := velocity_and_acceleration(sampled, installation):
        worst = max(excesses, key=lambda e: e.slower)
        others = sorted({e.joint for e in excesses} - {worst.joint})
        also = f" ({', '.join(others)} too)" if others else ""
        fitting = fitting_duration(sampled, installation)
        raise InputError(
            name, f"{worst}{also}", f"it fits when played in {fitting:.3f} s instead of {sampled.duration_s:.3f} s"
        )
    for k, end in ((0, "begins"), (-1, "ends")):
        for joint, speed in zip(installation.joint, sampled.dq[k], strict=True):
            if abs(speed) > _REST * joint.limits.velocity_rad_s:
                raise InputError(name, f"{joint.name} {end} at {speed:.3g} rad/s", "begin and end at rest")


def velocity_and_acceleration(sampled: SampledMotion, installation: Installation) -> list[Excess]:
    """What goes beyond the velocity and acceleration limits, the worst sample of each joint and quantity."""
    found = []
    for i, joint in enumerate(installation.joint):
        for quantity, unit, values, limit, power in (
            ("velocity", "rad/s", sampled.dq[:, i], joint.limits.velocity_rad_s, 1.0),
            ("acceleration", "rad/s²", sampled.ddq[:, i], joint.limits.acceleration_rad_s2, 0.5),
        ):
            size = np.abs(values)
            k = int(np.argmax(size >= (1 - _SLACK) * size.max()))  # of equal peaks the first
            ratio = float(size[k]) / limit
            if ratio > 1 + _SLACK:
                found.append(
                    Excess(joint.name, quantity, unit, float(values[k]), limit, float(sampled.t[k]), ratio**power)
                )
    return found


def fitting_duration(sampled: SampledMotion, installation: Installation) -> float:
    """Shortest duration in s at which the same path, evenly slowed, keeps the velocity and acceleration limits.

    Slowing by a factor s divides velocities by s and accelerations by s². Rounded up to the ms; never shorter than
    the motion is.
    """
    slower = max((e.slower for e in velocity_and_acceleration(sampled, installation)), default=1.0)
    if slower == 1.0:
        return sampled.duration_s
    return float(np.ceil(sampled.duration_s * slower * 1000 - 1e-6) / 1000)


def point_to_point(q0: Array, q1: Array, installation: Installation, speed: float = 0.5) -> SampledMotion:
    """A 5th-order move from ``q0`` to ``q1`` [rad] at the loop's rate, ``speed`` times as fast as the limits allow.

    ``speed`` above 0, at most 1. Raises InputError when an end lies outside the position limits.
    """
    if not 0 < speed <= 1:
        raise InputError(
            "point to point", f"speed {speed} is not above 0 and at most 1", "choose a share of the limits"
        )
    ends = np.array([q0, q1], dtype=float)
    if ends.shape != (2, len(installation.joint)):
        joints = len(installation.joint)
        raise InputError("point to point", f"ends of {ends.shape[1]} angles for {joints} joints", "give one a joint")
    if not np.isfinite(ends).all():
        raise InputError("point to point", "an end is not finite", "give numbers throughout")
    rate_hz = installation.cycle.rate_hz
    way = np.abs(ends[1] - ends[0])
    velocity = np.array([j.limits.velocity_rad_s for j in installation.joint])
    acceleration = np.array([j.limits.acceleration_rad_s2 for j in installation.joint])
    fastest = max(np.max(way * _PEAK_VELOCITY / velocity), np.sqrt(np.max(way * _PEAK_ACCELERATION / acceleration)))
    duration = max(float(fastest) / speed, _SHORTEST_S)
    periods = int(np.ceil(duration * rate_hz))
    t = np.arange(periods + 1) / rate_hz
    moved = SampledMotion(t, *RestToRest(ends, [periods / rate_hz], 5).evaluate(t))
    check_motion(moved, installation, "point to point")
    return moved


def _require_finite(sampled: SampledMotion, joints: tuple[str, ...], name: str) -> None:
    for quantity in ("q", "dq", "ddq"):
        bad = np.argwhere(~np.isfinite(getattr(sampled, quantity)))
        if len(bad):
            k, i = bad[0]
            raise InputError(
                name, f"{joints[i]}: {quantity} is not finite at {sampled.t[k]:.3f} s", "give numbers throughout"
            )


def _require_position(sampled: SampledMotion, installation: Installation, name: str) -> None:
    for i, joint in enumerate(installation.joint):
        low, high = joint.limits.position_rad
        q = sampled.q[:, i]
        over = np.maximum(q - high, low - q)
        k = int(np.argmax(over))
        if over[k] > _SLACK * max(1.0, abs(low), abs(high)):
            bound = high if q[k] > high else low
            raise InputError(
                name,
                f"{joint.name} reaches {q[k]:.4g} rad at {sampled.t[k]:.3f} s, {over[k]:.3g} rad beyond {bound:g}",
                f"keep it between {low:g} and {high:g} rad",
            )
