"""Watches how the joints move: no angle jumps, and every joint is where it is told to be."""

from __future__ import annotations

import math
from collections.abc import Sequence
from typing import NamedTuple

from config import Installation
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.gate import OVERSPEED

STANDSTILL = 0.25
"""Share of the following error after which a joint whose angle has not changed at all while it was told to move is
stuck, or its encoder is."""
SLACK_COUNTS = 8
"""Quantisation and sensor noise that an angle may jump by beside its motion."""


class Astray(NamedTuple):
    """A joint whose angle is not to be believed, or that does not obey."""

    joint: int
    sentence: str


class Tracking:
    """Looks at each cycle's angles; tells, and never acts."""

    def __init__(self, installation: Installation) -> None:
        period_s = 1.0 / installation.cycle.rate_hz
        self._period_ns = installation.cycle.period_ns
        self._names = installation.joint_names
        self._step = [OVERSPEED * joint.limits.velocity_rad_s * period_s for joint in installation.joint]
        self._slack = [SLACK_COUNTS * 2 * math.pi / joint.encoder.counts_per_turn for joint in installation.joint]
        self._astray = [joint.limits.following_error_rad for joint in installation.joint]
        self._known: list[float | None] = [None] * len(self._names)
        self._known_ns = [0] * len(self._names)
        """When each joint was last heard of: cycles that a stalled loop skipped are time in which it moved on."""
        self._count = [1.5 * 2 * math.pi / joint.encoder.counts_per_turn for joint in installation.joint]
        self._stood: list[tuple[float, float] | None] = [None] * len(self._names)
        """Angle at which each joint has stood still, and where it was told to be when that began."""

    def forget(self) -> None:
        """Start anew, after a commissioning or a reset."""
        self._known = [None] * len(self._names)
        self._stood = [None] * len(self._names)

    def look(self, feedback: ArmFeedback, q_d: Sequence[float], *, following: bool) -> list[Astray]:
        """What is wrong with the angles of this cycle.

        ``q_d``: where the joints were last told to be, rad; compared where ``following``: the drives are enabled and
        follow it.
        """
        known, known_ns, q, now_ns = self._known, self._known_ns, feedback.q, feedback.time_ns
        wrong: list[Astray] = []
        if not feedback.complete:
            self._with_gaps(feedback)
            return wrong
        for i, angle in enumerate(q):
            before = known[i]
            if before is not None:
                change = angle - before
                most = self._step[i] * max(1.0, (now_ns - known_ns[i]) / self._period_ns) + self._slack[i]
                if not -most <= change <= most:
                    sentence = f"its angle jumped by {change:.3g} rad, which it cannot do in the time"
                    wrong.append(Astray(i, f"{self._names[i]}: {sentence}; check encoder and cable"))
            if following and self._stands(i, angle, q_d[i]):
                sentence = "its angle does not change although it is told to move"
                wrong.append(Astray(i, f"{self._names[i]}: {sentence}; check brake, encoder and cable"))
            elif following and not -self._astray[i] <= q_d[i] - angle <= self._astray[i]:
                sentence = (
                    f"it is {q_d[i] - angle:.3g} rad from where it is told to be, more than its following_error_rad "
                    f"{self._astray[i]:g}"
                )
                wrong.append(Astray(i, f"{self._names[i]}: {sentence}; check brake, load, motor and encoder"))
        self._known = list(q)
        self._known_ns = [now_ns] * len(q)
        return wrong

    def _stands(self, i: int, angle: float, told: float) -> bool:
        stood = self._stood[i]
        if stood is None or abs(angle - stood[0]) > self._count[i]:
            self._stood[i] = angle, told
            return False
        return abs(told - stood[1]) > STANDSTILL * self._astray[i]

    def _with_gaps(self, feedback: ArmFeedback) -> None:
        """A joint that is not heard of may have moved on meanwhile."""
        for i, valid in enumerate(feedback.valid):
            if valid:
                self._known[i], self._known_ns[i] = feedback.q[i], feedback.time_ns
