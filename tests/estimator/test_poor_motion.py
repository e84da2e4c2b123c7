"""What recordings lack is said, joint by joint, and nothing is said of motions that have it all."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory
from estimator.plausibility import check_times, missing_motions

Array = NDArray[np.float64]
T = np.arange(0.0, 12.0, 0.004)
SWEEP = np.sin(2.0 * np.pi * 0.25 * T)
RAMP = 0.5 * T
THERE_AND_BACK = 0.5 * np.abs(T - 6.0)
CREEP = np.cumsum(0.002 * (1.0 + np.sin(T)))


def recorded(*joints: Array) -> Trajectory:
    noise = np.random.default_rng(1).normal(0.0, 1e-5, (len(T), 3))
    q = np.stack(joints, axis=1) + noise
    return Trajectory(T, q, np.random.default_rng(2).normal(0.0, 1.0, q.shape))


def test_all_kinds_are_told_by_joint(dda: RigidBody) -> None:
    assert missing_motions(dda, [recorded(SWEEP, 0.5 * SWEEP, 2.0 * SWEEP)]) == []
    (still,) = missing_motions(dda, [recorded(SWEEP, 0.0 * T, SWEEP)])
    assert still.startswith("joint2 never moves")
    (one_way,) = missing_motions(dda, [recorded(CREEP, SWEEP, SWEEP)])
    assert one_way.startswith("joint1 moves one way only")
    assert "backwards" in one_way
    (one_speed,) = missing_motions(dda, [recorded(SWEEP, SWEEP, THERE_AND_BACK)])
    assert one_speed.startswith("joint3 moves at one speed only")


def test_recordings_are_taken_together(dda: RigidBody) -> None:
    """What one recording lacks, another may have."""
    assert missing_motions(dda, [recorded(RAMP, SWEEP, 0.0 * T), recorded(-0.7 * RAMP, 0.0 * T, SWEEP)]) == []


def test_joints_that_move_one_after_the_other_move(dda: RigidBody) -> None:
    """In long recordings, of which none is looked at from end to end."""
    t = np.arange(0.0, 720.0, 0.02)

    def sweep(joint: int) -> Array:
        return np.where((t > 240.0 * joint) & (t < 240.0 * (joint + 1)), np.sin(0.5 * np.pi * t), 0.0)

    q = np.stack([sweep(joint) for joint in range(3)], axis=1)
    random = np.random.default_rng(0)
    recordings = [Trajectory(t, q + 1e-5 * random.normal(size=q.shape), random.normal(size=q.shape)) for _ in range(3)]
    assert missing_motions(dda, recordings) == []
    # A minute of each, as long as a whole look at them.
    assert missing_motions(dda, [one.rows(slice(10500, 13500)) for one in recordings[:1]])[0].startswith("joint3 never")


@pytest.mark.parametrize("unit", [1e3, 1e9, 1.0 / 6000.0])
def test_times_that_are_not_in_seconds(unit: float) -> None:
    right = recorded(SWEEP, 0.5 * SWEEP, 2.0 * SWEEP)
    check_times(right)
    with pytest.raises(InputError, match=r"s apart, .*; give times in seconds"):
        check_times(replace(right, t=unit * right.t))


def test_where_nothing_moves_nothing_is_judged(dda: RigidBody) -> None:
    with pytest.raises(InputError, match="no joint moves"):
        missing_motions(dda, [recorded(0.0 * T, 0.0 * T, 0.0 * T)])
