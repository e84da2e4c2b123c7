"""The damped stop in torque mode: velocity damping over gravity, until the arm is at rest."""

from __future__ import annotations

from collections.abc import Sequence

from config import Installation
from driver.gravity import RigidBody

REST_SPEED_RAD_S = 0.05
"""Below this on all joints the arm counts as being at rest; above the noise of a tachometer."""
REST_S = 0.02
"""For so long without interruption."""


HANDOVER_SPEED_RAD_S = 0.2
"""Below this the damped stop gives way to holding: where the model's gravity is wrong, damping alone lets a joint
creep on at (error of gravity)/D for ever."""


class RestWatch:
    """Tells when all joints that can be seen have been slower than ``speed_rad_s`` for long enough."""

    def __init__(self, installation: Installation, speed_rad_s: float = REST_SPEED_RAD_S) -> None:
        self._speed = speed_rad_s
        self._needed = max(1, round(REST_S * installation.cycle.rate_hz))
        self._quiet = 0

    def at_rest(self, dq: Sequence[float], valid: Sequence[bool]) -> bool:
        """Feed once a cycle."""
        slow = all(not ok or abs(v) < self._speed for v, ok in zip(dq, valid, strict=True))
        self._quiet = self._quiet + 1 if slow else 0
        return self._quiet >= self._needed


class DampedStop:
    """tau = g(q) − D·dq with the digital controller's damping D, bounded by torque limit and torque rate.

    The bounds are part of the law: a stop gives all that the limits allow, where a motion that asked for more
    would be refused. A joint that cannot be seen keeps its torque; its drive is stopped by other means.
    """

    def __init__(self, installation: Installation, body: RigidBody) -> None:
        self._body = body
        period_s = 1.0 / installation.cycle.rate_hz
        self._joints = [
            (j.digital.damping_nms_rad, j.limits.torque_nm, j.limits.torque_rate_nm_s * period_s)
            for j in installation.joint
        ]

    def torque(
        self, q_known: Sequence[float], dq: Sequence[float], valid: Sequence[bool], last_tau: Sequence[float]
    ) -> list[float]:
        """Torque of this cycle. ``q_known``: each joint's newest angle, for gravity; ``last_tau``: the last command."""
        gravity = self._body.gravity(q_known)
        out = []
        for i, (damping, limit, step) in enumerate(self._joints):
            last = last_tau[i]
            if not valid[i]:
                out.append(last)
                continue
            wanted = min(limit, max(-limit, gravity[i] - damping * dq[i]))
            out.append(min(last + step, max(last - step, wanted)))
        return out
