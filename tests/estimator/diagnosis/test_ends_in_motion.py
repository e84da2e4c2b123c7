"""Recordings that begin and end while the arm moves, as others' do."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.observed.stretches import KINEMATIC, Grid, calm_motion
from estimator.filtering import plan_filter

Array = NDArray[np.float64]
RATE = 250.0


@pytest.mark.parametrize("noise", [1e-5, 1e-3])
def test_the_calm_motion_keeps_its_accelerations_at_its_ends(noise: float) -> None:
    """In the last half of a period of its highest frequency; reflected at the end it lost a tenth of them."""
    random, t = np.random.default_rng(0), np.arange(0.0, 12.0, 1.0 / RATE)
    plan, grid = plan_filter(RATE, 10.0, flat=KINEMATIC), Grid(10.0, (), np.zeros(1), 2.0)
    errors, sizes = [], []
    for _ in range(30):
        w, phase, size = 1.2 * np.pi * random.uniform(0.1, 1.0, 5), random.uniform(0.0, 7.0, 5), random.normal(size=5)
        waves = size * np.sin(w * t[:, None] + phase)
        measured = waves.sum(axis=1) + noise * random.normal(size=len(t))
        true = -(w**2 * waves).sum(axis=1)[plan.edge : len(t) - plan.edge]
        found = calm_motion(grid, plan, measured[:, None]).ddq[:, 0]
        ends = np.r_[: int(0.25 * RATE), len(true) - int(0.25 * RATE) : len(true)]
        errors.append((found - true)[ends])
        sizes.append(true)
    assert np.sqrt(np.mean(np.square(errors))) < 0.02 * np.sqrt(np.mean(np.square(sizes)))


@pytest.mark.parametrize(("rest", "most"), [(0.3, 0.03), (0.5, 0.006)])
def test_a_motion_that_begins_soon_after_its_recording_was_at_rest(rest: float, most: float) -> None:
    """No polynomial is that: by one it was wrong by several times as much."""
    t = np.arange(-rest, 1.3 + rest, 1e-3)
    s = np.clip(t / 1.3, 0.0, 1.0)
    q = 2.0 * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5) + 1e-5 * np.random.default_rng(0).normal(size=len(t))
    ddq = 2.0 * (60.0 * s - 180.0 * s**2 + 120.0 * s**3) / 1.3**2
    plan, grid = plan_filter(1e3, 25.0, flat=KINEMATIC), Grid(25.0, (), np.zeros(1), 3.0)
    true, near = ddq[plan.edge : len(t) - plan.edge], int(0.5 * 1e3 / 3.0)
    error = calm_motion(grid, plan, q[:, None]).ddq[:, 0] - true
    assert np.sqrt(np.mean(np.square(np.r_[error[:near], error[-near:]]))) < most * ddq.std()


def test_a_heavy_load_leaves_nothing_at_the_ends_of_recordings(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> None:
    """Its torques are a thousand times the noise of the light joints, and were told as unexplained."""
    body, random, recordings = make_chain("rrrr"), np.random.default_rng(1), []
    loaded = body.prior()
    # A body of 2 kg, 0.1 m out.
    loaded[30:34] += [2.0, 0.0, 0.0, 0.2]
    loaded[[34, 36, 39]] += [0.03, 0.03, 0.01]
    for motion in range(3):
        t, q, dq, ddq = make_periodic(4, 9.0, RATE, motion)
        tau = inverse_dynamics(body, loaded, q, dq, ddq)
        noise = 1e-3 * np.sqrt(np.mean(tau**2, axis=0))
        # Each playing from another moment on, in the middle of the motion.
        for begin in (0, 40):
            part = slice(begin, begin + 2000)
            measured = q[part] + 5e-5 * random.normal(size=(2000, 4))
            recordings.append(
                Trajectory(t[part], measured, tau[part] + noise * random.normal(size=(2000, 4)), name=f"{motion}")
            )
    found = diagnose(body, recordings)
    assert {f.effect for f in found.findings} <= {"payload", "link_inertia"}
    assert found.findings
    assert not found.unexplained
