"""An arm that stands outside its limits, brought back: slowly, straight inside, by the loop and gate of every motion.

An arm pushed by hand, or whose limits were narrowed, can be outside of what the gate admits; its drives clip what they
are told to the same limits. For the way back both are set up with limits that reach to where each joint stands, and
with a tenth of its speed. The next daemon sets the drives up with the arm's own.
"""

from __future__ import annotations

import os
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from config.motion import point_to_point
from driver.arm import ArmLoop
from driver.bus.channel import open_channel
from driver.cyclic.status import LoopStatus
from driver.plan import Plan
from service.outcomes import ArmStopped

FARTHEST_RAD = 0.5
"""A joint that seems farther outside was not parked there: rather its zero is wrong."""
SLOWER = 0.1
"""Share of a joint's speed that it may have on the way; the way itself is planned at half of that."""
INSIDE = 0.02
"""Share of a joint's range that it is brought inside."""
ROOM_RAD = 0.02
"""Beyond where a joint stands: it sags when its brake opens."""

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Outside:
    """A joint outside its limits: rad."""

    joint: str
    stands: float
    limit: float
    to: float
    """Where it is to be brought."""

    def __str__(self) -> str:
        return (
            f"{self.joint} stands at {self.stands:.4g} rad, {abs(self.stands - self.limit):.3g} beyond {self.limit:g}"
        )


def outside(installation: Installation, q: Array) -> list[Outside]:
    """Joints at ``q`` [rad] that the gate would not admit."""
    found = []
    for joint, angle in zip(installation.joint, q.tolist(), strict=True):
        low, high = joint.limits.position_rad
        if not low <= angle <= high:
            limit, inward = (high, -1.0) if angle > high else (low, 1.0)
            found.append(Outside(joint.name, angle, limit, limit + inward * INSIDE * (high - low)))
    return found


def reaching(installation: Installation, q: Array) -> Installation:
    """The installation with limits that reach to ``q``, and are slow.

    Raises InputError for a joint that is farther outside than anybody parks an arm.
    """
    for one in outside(installation, q):
        if abs(one.stands - one.limit) > FARTHEST_RAD:
            raise InputError(
                f"arm {installation.arm.name}",
                f"{one}, more than the {FARTHEST_RAD:g} rad that it is brought back by itself",
                "check its encoder's zero_rad; if that is right, move the joint by hand with its brake released",
            )
    joints = []
    for joint, angle in zip(installation.joint, q.tolist(), strict=True):
        low, high = joint.limits.position_rad
        reach = (min(low, angle - ROOM_RAD), max(high, angle + ROOM_RAD))
        limits = {"position_rad": reach, "velocity_rad_s": SLOWER * joint.limits.velocity_rad_s}
        joints.append(joint.model_copy(update={"limits": joint.limits.model_copy(update=limits)}))
    return installation.model_copy(update={"joint": tuple(joints)})


def in_lockstep(installation: Installation) -> bool:
    """Whether what is on the buses is a stand-in in virtual time. Raises InputError when a bus is not there."""
    with open_channel(installation.bus[0].channel) as channel:
        return channel.lockstep


def where_it_stands(installation: Installation, *, lockstep: bool) -> Array:
    """Measured angles, rad; no drive is enabled. Raises InputError when one is not heard of."""
    with ArmLoop.start(installation, lockstep=lockstep, ring_name=_ring(installation)) as loop:
        status = loop.status()
    if not all(status.valid):
        silent = next(n for n, heard in zip(installation.joint_names, status.valid, strict=True) if not heard)
        raise InputError(f"arm {installation.arm.name}", f"{silent} is not heard of", "see etude check")
    return np.array(status.q)


def bring_inside(
    installation: Installation, q: Array, *, lockstep: bool, progress: Callable[[str, float], None]
) -> LoopStatus:
    """Move what is outside at ``q`` [rad] straight inside, the other joints held; drives off at the end.

    Raises InputError when it is not begun, ArmStopped when the arm stopped on the way. However it is left, the loop
    brings the arm to rest first.
    """
    mode = installation.modes[0]
    wide = reaching(installation, q)
    with ArmLoop.start(wide, lockstep=lockstep, ring_name=_ring(installation)) as loop:
        loop.enable(mode)
        held = np.array(loop.status().q_d)
        to = {one.joint: one.to for one in outside(installation, held)}
        goal = [to.get(joint, angle) for joint, angle in zip(wide.joint_names, held.tolist(), strict=True)]
        way = point_to_point(held, np.array(goal), wide)
        run = loop.play(Plan(way.q, way.dq, way.ddq, mode=mode, controller="pd+ff", name="back inside the limits"))
        status = loop.wait(run, told=lambda now: progress("moving back inside the limits", now.progress))
        if status.run_outcome != "done":
            raise ArmStopped(status.run_outcome or "another motion took its place")
        loop.disable()
        return loop.status()


def _ring(installation: Installation) -> str:
    return f"etude-{installation.arm.name}-{os.getpid()}"
