"""The planar arm of Section 6.5, simulated: truth for the learner, in code of its own."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field

import numpy as np
import pytest
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.trial import Reference, Timing, Trial

Array = NDArray[np.float64]
SHAPE = Polynomial([0, 0, 0, 0, 35, -84, 70, -20])
SUBSTEPS = 4


class PlanarModel:
    """Two uniform rods of 1 kg and 1 m in a horizontal plane (Brady et al. 1982)."""

    def torque(self, q: Array, dq: Array, ddq: Array) -> Array:
        c, s = np.cos(q[:, 1]), 0.5 * np.sin(q[:, 1])
        off = 1 / 3 + 0.5 * c
        first = (5 / 3 + c) * ddq[:, 0] + off * ddq[:, 1] - s * (2 * dq[:, 0] + dq[:, 1]) * dq[:, 1]
        return np.column_stack([first, off * ddq[:, 0] + ddq[:, 1] / 3 + s * dq[:, 0] ** 2])


@dataclass
class PlanarArm:
    """Plays feedforward on the arm with its servo, torques held over a sample. Friction and noise are hidden."""

    loop: FeedbackLoop
    coulomb: Array = field(default_factory=lambda: np.zeros(2))
    ripple: float = 0.0
    """Share of the torque, 30 periods a turn."""
    tip_mass: float = 0.0
    """kg at the end of the second rod."""
    torque_noise: float = 0.0
    velocity_noise: float = 0.0
    rng: np.random.Generator = field(default_factory=lambda: np.random.default_rng(1))
    timing: Timing = field(default_factory=lambda: Timing(held=True, advance=1))

    def play(self, reference: Reference, feedforward: Array) -> Trial:
        """Sample j of the feedforward acts between samples j and j + 1."""
        h, k, d = self.loop.period, self.loop.stiffness, self.loop.damping
        q, dq = reference.q[0].copy(), np.zeros(2)
        angles, speeds, torques = [q], [dq], [np.zeros(2)]
        for j in range(reference.samples - 1):
            seen = dq + self.velocity_noise * self.rng.standard_normal(2)
            command = feedforward[j] + k * (reference.q[j] - q) + d * (reference.dq[j] - seen)
            push = command + self.torque_noise * self.rng.standard_normal(2)
            for _ in range(SUBSTEPS):
                q, dq = self._step(q, dq, push, h / SUBSTEPS)
            angles.append(q)
            speeds.append(dq + self.velocity_noise * self.rng.standard_normal(2))
            torques.append(command)
        return Trial(np.array(angles), np.array(speeds), np.array(torques))

    def _step(self, q: Array, dq: Array, tau: Array, h: float) -> tuple[Array, Array]:
        k1 = self._ddq(q, dq, tau)
        k2 = self._ddq(q + h / 2 * dq, dq + h / 2 * k1, tau)
        k3 = self._ddq(q + h / 2 * dq + h * h / 4 * k1, dq + h / 2 * k2, tau)
        k4 = self._ddq(q + h * dq + h * h / 2 * k2, dq + h * k3, tau)
        return q + h * dq + h * h / 6 * (k1 + k2 + k3), dq + h / 6 * (k1 + 2 * k2 + 2 * k3 + k4)

    def _ddq(self, q: Array, dq: Array, tau: Array) -> Array:
        c, s, m = np.cos(q[1]), np.sin(q[1]), self.tip_mass
        first = 5 / 3 + c + m * (2 + 2 * c)
        off = 1 / 3 + 0.5 * c + m * (1 + c)
        second = 1 / 3 + m
        swing = (0.5 + m) * s
        tau = tau * (1 + self.ripple * np.sin(30 * q)) - self.coulomb * np.tanh(dq / 0.05)
        a = tau[0] + swing * (2 * dq[0] + dq[1]) * dq[1]
        b = tau[1] - swing * dq[0] ** 2
        det = first * second - off * off
        return np.array([second * a - off * b, first * b - off * a]) / det


def planar_motion(start_deg: Array, end_deg: Array, duration: float, period: float, rest: int = 0) -> Reference:
    """A 7th-order polynomial from rest to rest."""
    t = np.arange(round(duration / period) + 1) * period
    u, way = (t / duration)[:, None], np.deg2rad(np.subtract(end_deg, start_deg))[None]
    return Reference.between_rests(
        np.deg2rad(start_deg) + SHAPE(u) * way,
        SHAPE.deriv(1)(u) / duration * way,
        SHAPE.deriv(2)(u) / duration**2 * way,
        period, rest, rest,
    )  # fmt: skip


def planar_servo(period: float, bandwidth_hz: float = 1.0) -> FeedbackLoop:
    """Natural frequency 1 Hz and damping 0.707 at the inertias diag(5/3, 1/3)."""
    inertia, omega = np.array([5 / 3, 1 / 3]), 2 * np.pi * bandwidth_hz
    return FeedbackLoop(inertia * omega**2, inertia * 2 * 0.707 * omega, period)


@pytest.fixture
def planar_model() -> PlanarModel:
    return PlanarModel()


@pytest.fixture
def planar_arm() -> Callable[..., PlanarArm]:
    """``planar_arm(period, bandwidth_hz=1, **hidden)``."""
    return lambda period, bandwidth_hz=1.0, **hidden: PlanarArm(planar_servo(period, bandwidth_hz), **hidden)


@pytest.fixture
def motion() -> Callable[..., Reference]:
    """``motion(start_deg, end_deg, duration, period, rest=0)``."""
    return planar_motion
