"""Whether the arm can be enabled where it stands, and a plan can begin where it holds."""

from __future__ import annotations

from collections.abc import Sequence

from config import InputError, Installation
from config.schema import Mode
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.reference import BLEND_S
from driver.plan import Plan

START_TOLERANCE_RAD = 0.02
"""How far from where the arm holds a plan may begin; the difference is closed smoothly first."""
LEAD_IN_SHARE = 0.05
"""Share of the velocity limit that closing the difference may use."""
REST_SPEED_SHARE = 0.02
"""Share of the velocity limit below which a plan begins and ends at rest."""


def require_inside(installation: Installation, feedback: ArmFeedback) -> None:
    """Raises InputError when a joint stands outside its limits: it would be held there, which the gate refuses."""
    for joint, angle, heard in zip(installation.joint, feedback.q, feedback.valid, strict=True):
        low, high = joint.limits.position_rad
        if heard and not low <= angle <= high:
            raise InputError(
                "arm",
                f"cannot be enabled: {joint.name} stands at {angle:.4g} rad, outside its limits {low:g} to {high:g}",
                "end the daemon and bring it back slowly with `etude return`, or move it by hand",
            )


def require_start(plan: Plan, installation: Installation, mode: Mode, q_held: Sequence[float]) -> float:
    """Seconds that closing the difference between ``q_held`` [rad] and the plan's start takes.

    Raises InputError for a plan of another mode, one that begins elsewhere, or that does not begin and end at rest.
    """
    place = f"plan {plan.name}"
    if plan.mode != mode:
        raise InputError(place, f"is for {plan.mode}, the drives are enabled in {mode}", "enable that mode first")
    q, dq = plan.arrays[:2]
    lead_in_s = BLEND_S
    for i, joint in enumerate(installation.joint):
        off = abs(float(q[0, i]) - q_held[i])
        if off > START_TOLERANCE_RAD:
            raise InputError(
                place,
                f"{joint.name} begins at {q[0, i]:.4f} rad and the arm holds at {q_held[i]:.4f} rad",
                "move to its start first",
            )
        limit = joint.limits.velocity_rad_s
        speed = max(abs(float(dq[0, i])), abs(float(dq[-1, i])))
        if speed > REST_SPEED_SHARE * limit:
            raise InputError(place, f"{joint.name} has {speed:.3g} rad/s at its start or end", "begin and end at rest")
        # The steepest slope of the smooth step is 1.5 over its length.
        lead_in_s = max(lead_in_s, 1.5 * off / (LEAD_IN_SHARE * limit))
    return lead_in_s
