"""The one gate: every command to the drives passes here, or none does.

The gate never changes a command. What is not finite, out of range, too sudden, made from old feedback or not due
in the present state is refused with the joint, the quantity and the excess; the loop then stops the arm.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass

from config import Installation
from config.schema import Joint
from driver.cyclic.cycle import LoopState

SLACK = 1e-9
"""Relative slack for the last digit of a command that just touches its limit."""
ROUNDING = 1 + 1e-6
"""The same for differences of commands."""
OVERSPEED = 1.2
"""Measured speed is noisy and overshoots: refused beyond this multiple of the commanded speed's limit."""
OVERTRAVEL_RAD = 0.05
"""How far the measured position may be past a position limit that the command keeps."""
ENABLES = 0x0F
"""Controlword bits of "enable operation"."""
COMMANDING = frozenset({LoopState.ENABLING, LoopState.HOLDING, LoopState.PLAYING, LoopState.STOPPING})


@dataclass(frozen=True, slots=True)
class Refusal:
    """Why the gate stayed shut."""

    joint: str
    quantity: str
    value: float
    limit: float
    unit: str

    def __str__(self) -> str:
        excess = abs(self.value - self.limit)
        if not math.isfinite(self.value):
            return f"{self.joint}: {self.quantity} is {self.value}"
        return (
            f"{self.joint}: {self.quantity} {self.value:.5g} {self.unit} is {excess:.3g} {self.unit} "
            f"beyond its limit {self.limit:.5g} {self.unit}"
        )


@dataclass(frozen=True, slots=True)
class JointGate:
    """Bounds of one joint, each with its slack."""

    name: str
    low: float
    high: float
    velocity: float
    step: float
    """Of the commanded position in one cycle."""
    torque: float
    torque_rate: float

    @classmethod
    def of(cls, joint: Joint, period_s: float) -> JointGate:
        limits = joint.limits
        low, high = limits.position_rad
        velocity = limits.velocity_rad_s * (1 + SLACK)
        return cls(
            joint.name,
            low - SLACK * (1 + abs(low)),
            high + SLACK * (1 + abs(high)),
            velocity,
            velocity * period_s * ROUNDING,
            limits.torque_nm * (1 + SLACK),
            limits.torque_rate_nm_s * ROUNDING,
        )


class Gate:
    """Gate of one installation. Remembers the last command that passed, for steps and rates."""

    def __init__(self, installation: Installation) -> None:
        self.period_s = 1.0 / installation.cycle.rate_hz
        self.max_age = installation.cycle.missed_deadlines_to_stop
        """Cycles since a joint's feedback arrived, up to which a command may rest on it."""
        self._joints = tuple(JointGate.of(joint, self.period_s) for joint in installation.joint)
        self._bounds = [
            (
                g.torque, g.torque_rate * self.period_s, g.low, g.high, g.velocity, g.step,
                g.low - OVERTRAVEL_RAD, g.high + OVERTRAVEL_RAD, OVERSPEED * g.velocity,
            )
            for g in self._joints
        ]  # fmt: skip
        self._q_d = [0.0] * len(self._joints)
        self._tau = [0.0] * len(self._joints)

    def check(
        self,
        state: LoopState,
        words: Sequence[int],
        q_d: Sequence[float],
        dq_d: Sequence[float],
        tau: Sequence[float],
        q: Sequence[float],
        dq: Sequence[float],
        age: Sequence[int],
        *,
        position_is_sent: bool,
        torque_interval_s: float | None = None,
    ) -> Refusal | None:
        """None, and the command is remembered as sent; or the first thing that is wrong with it.

        ``q_d`` rad, ``dq_d`` rad/s, ``tau`` N·m: position, velocity and torque (or torque offset) commanded.
        ``q``, ``dq``: measured, looked at where the joint's ``age``, cycles since its feedback arrived, is 0.
        ``position_is_sent``: the drives follow q_d (CSP); in CST a stop has no reference to be checked.
        ``torque_interval_s``: time that a step of torque may take, a controller's period when it is longer than
        the loop's. While stopping, the measured state may be the very cause and refuses nothing.
        In a state that commands nothing, no ``words`` (controlwords) may enable a drive, and steps are free.
        """
        if state not in COMMANDING:
            return self._check_idle(state, words, q_d, tau)
        stopping = state is LoopState.STOPPING
        # Most cycles pass everything: then the exceptions of stops and gaps need no look, nor do slower controllers.
        if not stopping and not any(age) and self._passes(q_d, dq_d, tau, q, dq):
            self._q_d, self._tau = list(q_d), list(tau)
            return None
        rate_s = torque_interval_s or self.period_s
        reference = position_is_sent or not stopping
        # Written so that NaN fails every comparison; `_reason` repeats them one by one where one failed.
        for i, (g, a, v, t, last_a, last_t) in enumerate(
            zip(self._joints, q_d, dq_d, tau, self._q_d, self._tau, strict=True)
        ):
            torque, low, high, velocity, step = g.torque, g.low, g.high, g.velocity, g.step
            most = g.torque_rate * rate_s
            passed = -torque <= t <= torque and -most <= t - last_t <= most
            if reference:
                passed = passed and low <= a <= high and -velocity <= v <= velocity and -step <= a - last_a <= step
            if passed and not stopping:
                if age[i] == 0:
                    passed = (
                        low - OVERTRAVEL_RAD <= q[i] <= high + OVERTRAVEL_RAD
                        and -OVERSPEED * velocity <= dq[i] <= OVERSPEED * velocity
                    )
                else:
                    passed = age[i] <= self.max_age
            if not passed:
                return self._reason(i, a, v, t, q[i], dq[i], age[i], reference=reference, rate_s=rate_s)
        self._q_d, self._tau = list(q_d), list(tau)
        return None

    def _passes(
        self,
        q_d: Sequence[float],
        dq_d: Sequence[float],
        tau: Sequence[float],
        q: Sequence[float],
        dq: Sequence[float],
    ) -> bool:
        """Whether every bound is kept with all joints heard of, and torques may change at each cycle."""
        for (torque, change, low, high, velocity, step, lowest, highest, fastest), a, v, t, x, w, last_a, last_t in zip(
            self._bounds, q_d, dq_d, tau, q, dq, self._q_d, self._tau, strict=True
        ):
            if not (
                -torque <= t <= torque
                and -change <= t - last_t <= change
                and low <= a <= high
                and -velocity <= v <= velocity
                and -step <= a - last_a <= step
                and lowest <= x <= highest
                and -fastest <= w <= fastest
            ):
                return False
        return True

    def _reason(
        self, i: int, a: float, v: float, t: float, x: float, w: float, age: int, *, reference: bool, rate_s: float
    ) -> Refusal:
        """The first bound that joint ``i`` violates."""
        g = self._joints[i]
        change, most = t - self._tau[i], g.torque_rate * rate_s
        candidates = [
            ("commanded torque", t, -g.torque, g.torque, "N·m"),
            ("step of commanded torque", change, -most, most, "N·m"),
        ]
        if reference:
            candidates += [
                ("commanded position", a, g.low, g.high, "rad"),
                ("commanded velocity", v, -g.velocity, g.velocity, "rad/s"),
                ("step of commanded position in a cycle", a - self._q_d[i], -g.step, g.step, "rad"),
            ]
        if age:
            candidates.append(("age of feedback", float(age), 0.0, float(self.max_age), "cycles"))
        else:
            fast = OVERSPEED * g.velocity
            candidates += [
                ("measured position", x, g.low - OVERTRAVEL_RAD, g.high + OVERTRAVEL_RAD, "rad"),
                ("measured velocity", w, -fast, fast, "rad/s"),
            ]
        what, value, low, high, unit = next(c for c in candidates if not c[2] <= c[1] <= c[3])
        return Refusal(g.name, what, value, low if value < low else high, unit)

    def _check_idle(
        self, state: LoopState, words: Sequence[int], q_d: Sequence[float], tau: Sequence[float]
    ) -> Refusal | None:
        for i, g in enumerate(self._joints):
            if words[i] & ENABLES == ENABLES:
                return Refusal(g.name, f"controlword that enables, while {state.name.lower()}", words[i], 0, "")
            for what, value, unit in (("commanded position", q_d[i], "rad"), ("commanded torque", tau[i], "N·m")):
                if not math.isfinite(value):
                    return Refusal(g.name, what, value, 0.0, unit)
        self._q_d, self._tau = list(q_d), list(tau)
        return None
