"""What the arm shall do at each cycle: hold, follow a plan, or slow down along one.

A reference gives position, velocity, acceleration and feedforward torque of all joints, one cycle after the other.
Torque never jumps between references: each begins from the feedforward that the one before it ended with.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from typing import Protocol

from config import Installation
from driver.plan import Plan

BLEND_S = 0.1
"""Time over which a holding arm's feedforward changes to another."""
STOP_SHARE = 0.9
"""Share of a joint's acceleration limit that slowing down along the path uses."""
SHORTEST_STOP_S, LONGEST_STOP_S = 0.03, 1.0


@dataclass(slots=True)
class Desired:
    """Reference of one cycle: rad, rad/s, rad/s², N·m, one value a joint."""

    q: list[float]
    dq: list[float]
    ddq: list[float]
    tau_ff: list[float]


class Reference(Protocol):
    """Produces one cycle's `Desired` after the other."""

    @property
    def done(self) -> bool:
        """Whether it has come to its end (it may be asked on, and holds)."""

    def next(self) -> Desired: ...


def smooth(s: float) -> float:
    """0 to 1 with zero slope at both ends."""
    return s * s * (3.0 - 2.0 * s) if 0.0 < s < 1.0 else float(s >= 1.0)


class Hold:
    """Stay at ``q``; the feedforward goes from ``tau_from`` to ``tau_to`` and stays.

    From ``q_from`` the position is approached in the same time, ``blend_s``.
    """

    def __init__(
        self,
        q: Sequence[float],
        tau_from: Sequence[float],
        tau_to: Sequence[float],
        period_s: float,
        q_from: Sequence[float] | None = None,
        blend_s: float = BLEND_S,
    ) -> None:
        self._q, self._from, self._to = list(q), list(tau_from), list(tau_to)
        self._q_from = list(q_from or q)
        self._zeros = [0.0] * len(self._q)
        self._step = period_s / blend_s
        self._share = 0.0

    @property
    def done(self) -> bool:
        return self._share >= 1.0

    def next(self) -> Desired:
        self._share = min(1.0, self._share + self._step)
        if self._share >= 1.0:
            return Desired(self._q, self._zeros, self._zeros, self._to)
        s = smooth(self._share)
        return Desired(
            [a + s * (b - a) for a, b in zip(self._q_from, self._q, strict=True)],
            self._zeros,
            self._zeros,
            [a + s * (b - a) for a, b in zip(self._from, self._to, strict=True)],
        )


class Follow:
    """The samples of a plan, one a cycle. A cycle that is skipped delays it and never makes it jump."""

    def __init__(self, plan: Plan) -> None:
        self.plan = plan
        self.sample = 0
        """Samples given out."""

    @property
    def done(self) -> bool:
        return self.sample >= self.plan.samples

    @property
    def progress(self) -> float:
        return self.sample / self.plan.samples

    def next(self) -> Desired:
        k = min(self.sample, self.plan.samples - 1)
        self.sample = k + 1
        q, dq, ddq, tau_ff = self.plan.arrays
        return Desired(q[k].tolist(), dq[k].tolist(), ddq[k].tolist(), tau_ff[k].tolist())


class SlowDown:
    """Come to rest along the path of a plan: its clock runs ever slower, from one sample a cycle to none.

    With the clock's speed s'(t) falling smoothly from 1 to 0 the velocity is q'(s)·s' and never above the plan's,
    and the deceleration it adds is q'(s)·s'', kept at `STOP_SHARE` of every joint's limit where the stop may last long
    enough. The feedforward goes over to ``rest_torque``, which holds the arm.
    """

    def __init__(self, plan: Plan, sample: int, installation: Installation, tau_from: Sequence[float]) -> None:
        self.plan = plan
        self._at = float(max(0, min(sample - 1, plan.samples - 1)))
        self._rate = installation.cycle.rate_hz
        speed = plan.arrays[1][int(self._at)]
        # The steepest slope of the smooth step is 1.5 over its length.
        longest = max(
            1.5 * abs(float(v)) / (STOP_SHARE * j.limits.acceleration_rad_s2)
            for v, j in zip(speed, installation.joint, strict=True)
        )
        self._length = max(SHORTEST_STOP_S, min(LONGEST_STOP_S, longest)) * self._rate
        self._cycle = 0
        self._tau_from = list(tau_from)
        self.rest_torque = list(tau_from)
        """Feedforward at the end of the stop; set it to what holds the arm there."""

    @property
    def done(self) -> bool:
        return self._cycle >= self._length

    def next(self) -> Desired:
        self._cycle += 1
        share = min(1.0, self._cycle / self._length)
        clock = 1.0 - smooth(share)
        slope = -6.0 * share * (1.0 - share) / self._length * self._rate
        last = self.plan.samples - 1
        self._at = min(float(last), self._at + clock)
        k = min(int(self._at), last - 1)
        part = self._at - k
        q, dq, ddq, _ = self.plan.arrays
        position = (q[k] + part * (q[k + 1] - q[k])).tolist()
        if self._at >= last:
            clock = slope = 0.0
        path_speed = dq[k] + part * (dq[k + 1] - dq[k])
        path_acceleration = ddq[k] + part * (ddq[k + 1] - ddq[k])
        blend = smooth(share)
        return Desired(
            position,
            (path_speed * clock).tolist(),
            (path_acceleration * clock * clock + path_speed * slope).tolist(),
            [a + blend * (b - a) for a, b in zip(self._tau_from, self.rest_torque, strict=True)],
        )


def cycles_in(seconds: float, installation: Installation) -> int:
    """Whole cycles that a time takes, at least one."""
    return max(1, math.ceil(seconds * installation.cycle.rate_hz))
