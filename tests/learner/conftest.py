"""The planar arm of Section 6.5, simulated: truth for the learner, in code of its own."""

from __future__ import annotations

import math
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
SUBSTEPS = 2
State = tuple[float, float, float, float]
"""q1, q2, dq1, dq2."""


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
    coulomb: tuple[float, float] = (0.0, 0.0)
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
        h, k, d = self.loop.period / SUBSTEPS, self.loop.stiffness, self.loop.damping
        noise = self.rng.standard_normal((3, reference.samples, 2))
        seen_noise, push_noise = self.velocity_noise * noise[:2], self.torque_noise * noise[2]
        state = (*reference.q[0].tolist(), 0.0, 0.0)
        states, torques = [state], [np.zeros(2)]
        for j in range(reference.samples - 1):
            q, dq = np.array(state[:2]), np.array(state[2:])
            command = feedforward[j] + k * (reference.q[j] - q) + d * (reference.dq[j] - dq - seen_noise[0, j])
            push = (command + push_noise[j]).tolist()
            for _ in range(SUBSTEPS):
                state = self._step(state, push, h)
            states.append(state)
            torques.append(command)
        history = np.array(states)
        return Trial(history[:, :2], history[:, 2:] + seen_noise[1], np.array(torques))

    def _step(self, x: State, tau: list[float], h: float) -> State:
        k1 = self._flow(x, tau)
        k2 = self._flow(_ahead(x, k1, h / 2), tau)
        k3 = self._flow(_ahead(x, k2, h / 2), tau)
        k4 = self._flow(_ahead(x, k3, h), tau)
        a, b, c, d = (h / 6 * (p + 2 * q + 2 * r + s) for p, q, r, s in zip(k1, k2, k3, k4, strict=True))
        return x[0] + a, x[1] + b, x[2] + c, x[3] + d

    def _flow(self, x: State, tau: list[float]) -> State:
        q1, q2, v1, v2 = x
        c, m = math.cos(q2), self.tip_mass
        first = 5 / 3 + c + m * (2 + 2 * c)
        off = 1 / 3 + 0.5 * c + m * (1 + c)
        second = 1 / 3 + m
        swing = (0.5 + m) * math.sin(q2)
        one = tau[0] * (1 + self.ripple * math.sin(30 * q1)) - self.coulomb[0] * math.tanh(v1 / 0.05)
        two = tau[1] * (1 + self.ripple * math.sin(30 * q2)) - self.coulomb[1] * math.tanh(v2 / 0.05)
        a = one + swing * (2 * v1 + v2) * v2
        b = two - swing * v1**2
        det = first * second - off * off
        return v1, v2, (second * a - off * b) / det, (first * b - off * a) / det


def _ahead(x: State, flow: State, h: float) -> State:
    return x[0] + h * flow[0], x[1] + h * flow[1], x[2] + h * flow[2], x[3] + h * flow[3]


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
