"""Joints at rest: what friction does there is no function of velocity, and must not be fitted as one."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator import RigidBody, Trajectory, identify_links
from estimator.standstill import motion_weight, rest_speeds

LEVEL = np.array([9.0, 5.0, 3.0])


@pytest.fixture
def held_by_friction(measured_dda: Callable[..., list[Trajectory]]) -> list[Trajectory]:
    """Before and after each motion, friction holds the joints with a torque anywhere within its level."""
    random = np.random.default_rng(4)
    result = []
    for trajectory in measured_dda(torque_noise=0.2, coulomb=tuple(LEVEL)):
        tau, still = trajectory.tau.copy(), np.all(trajectory.dq == 0.0, axis=1)
        first_motion = int(np.flatnonzero(~still)[0])
        for part in (slice(0, first_motion), slice(len(tau) - 290, None)):
            tau[part] += random.uniform(-1.0, 1.0, 3) * LEVEL
        result.append(replace(trajectory, tau=tau))
    return result


def test_static_friction_biases_nothing(dda: RigidBody, held_by_friction: list[Trajectory]) -> None:
    found = identify_links(dda, held_by_friction)
    friction = {t.joint: v for t, v in zip(found.terms, found.value[15:], strict=True) if t.name == "coulomb_friction"}
    assert [friction[joint] for joint in range(3)] == pytest.approx(LEVEL, rel=0.03)
    assert found.fit.relative_error < 1.0
    for residual in found.fit.joints.values():
        assert 0.5 < residual.in_motion < 0.95
        assert residual.rms < 0.3


def test_weight_is_zero_at_rest_and_one_in_motion() -> None:
    """On a joint that stops for a second, twice, with noise that is no motion."""
    random = np.random.default_rng(2)
    t = np.arange(10_000) * 1e-3
    resting = ((t > 3.0) & (t < 4.0)) | ((t > 7.0) & (t < 8.0))
    dq = np.where(resting, 0.0, 1.0) + 0.2 * random.normal(size=len(t))
    weight = motion_weight(dq[:, None], np.array([0.08]), 100)[0]
    settled = np.abs(t[:, None] - np.array([3.0, 4.0, 7.0, 8.0])).min(axis=1) > 0.3
    assert np.abs(weight[resting & settled]).max() < 1e-12
    assert np.abs(weight[~resting & settled] - 1.0).max() < 1e-12
    assert np.abs(np.diff(weight)).max() < 0.02


def test_a_joint_that_hardly_moves_counts_whole(dda: RigidBody) -> None:
    t = np.arange(0.0, 20.0, 1e-2)
    q = np.column_stack([np.sin(t), np.where(t > 19.0, t - 19.0, 0.0), np.zeros_like(t)])
    speeds = rest_speeds([Trajectory(t, q, np.zeros_like(q))])
    assert speeds[0] == pytest.approx(0.08 * np.sqrt(0.5), rel=0.05)
    assert speeds[1] == speeds[2] == 0.0
