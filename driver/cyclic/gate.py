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
    name: str
    low: float
    high: float
    velocity: float
    torque: float
    torque_rate: float


def _joint_gate(joint: Joint) -> JointGate:
    limits = joint.limits
    low, high = limits.position_rad
    return JointGate(
        joint.name,
        low - SLACK * (1 + abs(low)),
        high + SLACK * (1 + abs(high)),
        limits.velocity_rad_s * (1 + SLACK),
        limits.torque_nm * (1 + SLACK),
        limits.torque_rate_nm_s,
    )


class Gate:
    """Gate of one installation. Remembers the last command that passed, for steps and rates."""

    def __init__(self, installation: Installation) -> None:
        self.period_s = 1.0 / installation.cycle.rate_hz
        self.max_age = installation.cycle.missed_deadlines_to_stop
        """Cycles since a joint's feedback arrived, up to which a command may rest on it."""
        self._joints = tuple(map(_joint_gate, installation.joint))
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
        last_q, last_tau = self._q_d, self._tau
        stopping = state is LoopState.STOPPING
        reference = position_is_sent or not stopping
        step_s = self.period_s * (1 + 1e-6)
        rate_s = (torque_interval_s or self.period_s) * (1 + 1e-6)
        for i, g in enumerate(self._joints):
            # Written so that NaN fails every comparison.
            t = tau[i]
            if not -g.torque <= t <= g.torque:
                return Refusal(g.name, "commanded torque", t, math.copysign(g.torque, t), "N·m")
            change, most = t - last_tau[i], g.torque_rate * rate_s
            if not -most <= change <= most:
                return Refusal(g.name, "step of commanded torque", change, math.copysign(most, change), "N·m")
            if reference:
                a, v = q_d[i], dq_d[i]
                if not g.low <= a <= g.high:
                    return Refusal(g.name, "commanded position", a, g.low if a < g.low else g.high, "rad")
                if not -g.velocity <= v <= g.velocity:
                    return Refusal(g.name, "commanded velocity", v, math.copysign(g.velocity, v), "rad/s")
                step, most = a - last_q[i], g.velocity * step_s
                if not -most <= step <= most:
                    return Refusal(
                        g.name, "step of commanded position in a cycle", step, math.copysign(most, step), "rad"
                    )
            if stopping:
                continue
            if age[i] > self.max_age:
                return Refusal(g.name, "age of feedback", age[i], self.max_age, "cycles")
            if age[i] == 0:
                x, w = q[i], dq[i]
                if not g.low - OVERTRAVEL_RAD <= x <= g.high + OVERTRAVEL_RAD:
                    limit = g.low - OVERTRAVEL_RAD if x < g.low else g.high + OVERTRAVEL_RAD
                    return Refusal(g.name, "measured position", x, limit, "rad")
                if not -OVERSPEED * g.velocity <= w <= OVERSPEED * g.velocity:
                    return Refusal(g.name, "measured velocity", w, math.copysign(OVERSPEED * g.velocity, w), "rad/s")
        last_q[:] = q_d
        last_tau[:] = tau
        return None

    def _check_idle(
        self, state: LoopState, words: Sequence[int], q_d: Sequence[float], tau: Sequence[float]
    ) -> Refusal | None:
        for i, g in enumerate(self._joints):
            if words[i] & ENABLES == ENABLES:
                return Refusal(g.name, f"controlword that enables, while {state.name.lower()}", words[i], 0, "")
            for what, value, unit in (("commanded position", q_d[i], "rad"), ("commanded torque", tau[i], "N·m")):
                if not math.isfinite(value):
                    return Refusal(g.name, what, value, 0.0, unit)
        self._q_d[:] = q_d
        self._tau[:] = tau
        return None
