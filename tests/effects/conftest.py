"""A six-joint arm, a rich motion of it, and everything an effect may look at."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from config.loader import HERE
from estimator.effects import Scales, Signals
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody, load_rigid_body

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]
BAND = 15.0


def fourier_motion(n: int, duration: float = 4.0, rate: float = 200.0, seed: int = 4) -> Motion:
    """t, q, dq, ddq: three harmonics a joint, periodic."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, duration, 1.0 / rate)
    amplitude, phase = random.uniform(0.1, 0.5, (3, n)), random.uniform(0.0, 2.0 * np.pi, (3, n))
    w = 2.0 * np.pi / duration * np.array([1, 2, 4])[:, None]
    x = t[:, None, None] * w + phase
    q = (amplitude * np.sin(x)).sum(axis=1)
    dq = (amplitude * w * np.cos(x)).sum(axis=1)
    ddq = (-amplitude * w**2 * np.sin(x)).sum(axis=1)
    return t, q, dq, ddq


@pytest.fixture(scope="session")
def motion(arm: RigidBody) -> Motion:
    """A short one, for simulations."""
    t, q, dq, ddq = fourier_motion(arm.n)
    return t[:480], q[:480], dq[:480], ddq[:480]


@pytest.fixture(scope="session")
def arm() -> RigidBody:
    return load_rigid_body(HERE / "arms" / "puma600" / "puma600.urdf")


@pytest.fixture(scope="session")
def signals_of(arm: RigidBody) -> Callable[..., Signals]:
    """Signals of any motion of joints that warm, with a measured torque, a velocity sensor and a wrist sensor that read
    the truth."""

    def make(motion: Motion) -> Signals:
        t, q, dq, ddq = motion
        tau = inverse_dynamics(arm, arm.prior(), q, dq, ddq)
        wrench = 5.0 * np.column_stack([np.sin(3.0 * t + k) for k in range(6)])
        warming = np.repeat(20.0 + 2.0 * t[:, None], arm.n, axis=1)
        sensed = {"tau": tau, "dq_measured": dq, "temperature": warming, "wrench": wrench, "load_wrench": wrench}
        return Signals(arm, t, q, dq, ddq, tau, **sensed)

    return make


@pytest.fixture(scope="session")
def signals(arm: RigidBody, signals_of: Callable[..., Signals]) -> Signals:
    return signals_of(fourier_motion(arm.n))


@pytest.fixture(scope="session")
def scales(signals: Signals) -> Scales:
    return Scales.of([signals], BAND)
