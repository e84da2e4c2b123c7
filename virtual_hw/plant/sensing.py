"""The drive's own sensors at run time: one sample a servo tick."""

from __future__ import annotations

import math

from config.schema import Encoder
from virtual_hw.hidden.delay import DelayLine
from virtual_hw.hidden.joint_sensors import AngleSensor, TorqueSensor, VelocitySensor

DIFFERENTIATED_BANDWIDTH_HZ = 150.0


class JointSensors:
    """Encoder counts, velocity and torque of one joint as the drive has them after `sample`."""

    __slots__ = (
        "_angle",
        "_angle_delay",
        "_angle_errors",
        "_counts_per_rad",
        "_last_counts",
        "_period",
        "_share",
        "_tachometer",
        "_torque",
        "_torque_delay",
        "_velocity",
        "_velocity_delay",
        "_zero",
        "counts",
        "torque",
        "velocity",
    )

    def __init__(
        self,
        encoder: Encoder,
        angle: AngleSensor,
        velocity: VelocitySensor,
        torque: TorqueSensor,
        tachometer: bool,
        period_s: float,
        q: float,
    ) -> None:
        self._angle, self._velocity, self._torque = angle, velocity, torque
        self._angle_errors = bool(angle.eccentricity_rad or angle.interpolation_rad or angle.offset_rad)
        self._tachometer, self._period = tachometer, period_s
        self._counts_per_rad = encoder.sign * encoder.counts_per_turn / (2.0 * math.pi)
        self._zero = encoder.zero_rad
        bandwidth = velocity.bandwidth_hz or (math.inf if tachometer else DIFFERENTIATED_BANDWIDTH_HZ)
        self._share = 1.0 - math.exp(-2.0 * math.pi * bandwidth * period_s)
        self._angle_delay = DelayLine(angle.delay_s, period_s, q) if angle.delay_s else None
        self._velocity_delay = DelayLine(velocity.delay_s, period_s, 0.0) if velocity.delay_s else None
        self._torque_delay = DelayLine(torque.delay_s, period_s, 0.0) if torque.delay_s else None
        self.velocity = 0.0
        """rad/s."""
        self.torque = 0.0
        """N·m at the joint."""
        self.counts = self._count(q, 0.0)
        """Raw counts of the joint encoder."""
        self._last_counts = self.counts

    def _count(self, q: float, noise: float) -> int:
        if self._angle_errors:
            q += self._angle.error(q)
        return math.floor((q + noise - self._zero) * self._counts_per_rad + 0.5)

    def sample(
        self, q: float, dq: float, current_nm: float, angle_noise: float, velocity_noise: float, torque_noise: float
    ) -> None:
        """Take the true angle, speed and torque current of this instant, with this tick's noise."""
        if self._angle_delay is not None:
            q = self._angle_delay.push(q)
        self.counts = counts = self._count(q, angle_noise)
        if self._tachometer:
            law = self._velocity
            measured = dq * law.gain
            if law.ripple:
                measured *= 1.0 + law.ripple * math.sin(law.ripple_order * q)
            measured += law.offset_rad_s + velocity_noise
        else:
            measured = (counts - self._last_counts) / (self._counts_per_rad * self._period)
            self._last_counts = counts
        if self._velocity_delay is not None:
            measured = self._velocity_delay.push(measured)
        self.velocity += self._share * (measured - self.velocity)
        if self._torque_delay is not None:
            current_nm = self._torque_delay.push(current_nm)
        self.torque = current_nm + self._torque.offset_nm + torque_noise
