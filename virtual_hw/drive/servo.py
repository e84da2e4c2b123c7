"""The drive's servo: cyclic position, velocity and torque with offsets, and the ramps that stop the axis.

All quantities are the drive's own: counts, counts/s, and N·m in the drive's positive direction.
"""

from __future__ import annotations

import math
from enum import IntEnum

SETTLE_NS = 20_000_000
"""How long a stopping axis is held after its reference has come to rest."""


class Mode(IntEnum):
    """Object 6060."""

    NONE = 0
    CSP = 8
    CSV = 9
    CST = 10


class Servo:
    """Position and damping gains around interpolated references: tau = k·(q_d − q) + d·(dq_d − dq) + offset."""

    def __init__(self, counts_per_turn: float, tick_ns: int) -> None:
        self._rad = 2.0 * math.pi / counts_per_turn
        self._tick_s = tick_ns * 1e-9
        self.stiffness = 0.0
        """N·m/count."""
        self.damping = 0.0
        """N·m·s/count."""
        self.step = 1.0
        """Share of the interpolation period that one tick is."""
        self.period_s = self._tick_s
        self.position = self.velocity = self.offset = 0.0
        """References now: counts, counts/s, N·m."""
        self._from = self._to = (0.0, 0.0, 0.0)
        self._share = 1.0
        self._slope = False
        self._integral = 0.0

    def set_gains(self, stiffness_raw: int, damping_raw: int) -> None:
        """Objects 2100:1 and 2100:2: 1000 · N·m/rad and 1000 · N·m·s/rad."""
        self.stiffness = stiffness_raw * 1e-3 * self._rad
        self.damping = damping_raw * 1e-3 * self._rad

    def set_period(self, period_s: float) -> None:
        """Interpolation period 60C2."""
        self.period_s = max(period_s, self._tick_s)
        self.step = self._tick_s / self.period_s

    def rest_at(self, position: float) -> None:
        """Begin with the references at a measured position, at rest."""
        self.position, self.velocity, self.offset = position, 0.0, 0.0
        self._from = self._to = (position, 0.0, 0.0)
        self._share = 1.0
        self._slope = False

    def aim(self, position: float, velocity: float | None, offset: float) -> None:
        """A new set-point, to be reached in one interpolation period; without a velocity the slope is taken."""
        self._slope = velocity is None
        if velocity is None:
            velocity = (position - self.position) / self.period_s
        self._from = (self.position, self.velocity, self.offset)
        self._to = (position, velocity, offset)
        self._share = 0.0

    def follow(self, counts: float, velocity: float) -> float:
        """Cyclic synchronous position: torque at this tick."""
        share = self._share
        if share < 1.0:
            share = min(1.0, share + self.step)
            self._share = share
            (p0, v0, t0), (p1, v1, t1) = self._from, self._to
            self.position = p0 + (p1 - p0) * share
            self.velocity = v0 + (v1 - v0) * share
            self.offset = t0 + (t1 - t0) * share
        elif self._slope:
            self.velocity = 0.0
        return self.stiffness * (self.position - counts) + self.damping * (self.velocity - velocity) + self.offset

    def follow_velocity(self, target: float, offset: float, counts: float, velocity: float) -> float:
        """Cyclic synchronous velocity: the position reference is the integral of the velocity's."""
        self.velocity, self.offset = target, offset
        self.position += target * self._tick_s
        return self.stiffness * (self.position - counts) + self.damping * (target - velocity) + offset

    def begin_stop(self, counts: float, velocity: float, torque: float) -> None:
        """Start a stopping ramp from the measured motion, without a jump of torque."""
        self.position, self.velocity = counts, velocity
        self._integral = torque

    def stop(self, deceleration: float, counts: float, velocity: float, limit: float) -> float:
        """One tick of the ramp to rest (counts/s²; infinite brakes at the torque limit), then hold.

        An integral part takes over gravity: the load neither drops nor droops. Its time 5·d/k keeps a servo of
        damping ratio above 0.32 stable.
        """
        reference = self.velocity
        change = deceleration * self._tick_s
        self.velocity = 0.0 if abs(reference) <= change else reference - math.copysign(change, reference)
        self.position += 0.5 * (reference + self.velocity) * self._tick_s
        error = self.position - counts
        if self.damping > 0.0:
            integral = self._integral + self.stiffness**2 / (5.0 * self.damping) * error * self._tick_s
            self._integral = max(-limit, min(limit, integral))
        return self.stiffness * error + self.damping * (self.velocity - velocity) + self._integral
