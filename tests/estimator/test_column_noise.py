"""Noise of the motion in the regressor's columns: its size, and what taking it out does to the bias."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import LinkOptions, RigidBody, Trajectory, base_parameters, identify_links, inverse_dynamics
from estimator.channel_noise import ChannelNoise, channel_noise
from estimator.column_noise import column_noise, motion_noise_autocovariance
from estimator.rows import make_layout, sum_up

Array = NDArray[np.float64]
Motion = Callable[[int, float, float, int], tuple[Array, ...]]
RATE = 200.0


def noisy(dda: RigidBody, make_periodic: Motion, run: int, motion: int, angle: float, torque: float) -> Trajectory:
    t, q, dq, ddq = make_periodic(3, 10.0, RATE, motion)
    random = np.random.default_rng([run, motion])
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq) + torque * random.normal(size=q.shape)
    return Trajectory(t, q + angle * random.normal(size=q.shape), tau)


def test_drawn_noise_is_the_noise_that_the_residual_shows(dda: RigidBody, make_periodic: Motion) -> None:
    """At the true parameters and without torque noise the residual is the columns' noise and nothing else."""
    base = base_parameters(dda)
    layout = make_layout(dda, base, [(), (), ()])
    truth = base.combination @ dda.prior()
    recordings = [noisy(dda, make_periodic, run, 5, 2e-4, 0.0) for run in range(4)]
    white = np.full((2, 3), 2e-4**2 * 2.0 / RATE)
    noise = column_noise(layout, recordings, 12.0, ChannelNoise(np.array([0.5, 100.0]), white, None))
    predicted = motion_noise_autocovariance(layout, noise, truth)
    sums = sum_up(layout, recordings, 12.0)
    for joint in range(3):
        mine = np.append(-truth[layout.unknowns(joint)], 1.0)
        p = len(mine)
        seen = sum(mine @ b.lagged[joint][0, :p, :p] @ mine for b in sums.batches) / sums.rows
        assert predicted[joint, 0] == pytest.approx(seen, rel=0.3)
    # Acceleration noise grows with frequency, so neighbouring rows oppose each other.
    assert np.all(predicted[:, 1] < 0.0)


def test_bias_of_noisy_angles_is_taken_out(dda: RigidBody, make_periodic: Motion) -> None:
    errors: dict[str, list[Array]] = {"weighted": [], "total_least_squares": [], "optimal_filter": []}
    for run in range(10):
        recordings = [noisy(dda, make_periodic, run, motion, 4e-3, 0.3) for motion in (5, 6)]
        for estimator, found in errors.items():
            result = identify_links(dda, recordings, LinkOptions(estimator=estimator, terms=()))
            found.append((result.beta - result.base.combination @ dda.prior()) / result.standard_error[:15])
    # In standard errors, root mean square over the unknowns: beyond one, intervals would not hold.
    bias = {name: float(np.sqrt(np.mean(np.mean(each, axis=0) ** 2))) for name, each in errors.items()}
    assert bias["weighted"] > 1.5
    for corrected in ("total_least_squares", "optimal_filter"):
        assert bias[corrected] < 0.33 * bias["weighted"]
        assert bias[corrected] < 0.7


def test_noise_of_recordings_without_a_window_is_not_known(dda: RigidBody, make_periodic: Motion) -> None:
    assert (
        channel_noise([Trajectory(*(x[:200] for x in make_periodic(3, 10.0, RATE, 5)[:2]), np.zeros((200, 3)))]) is None
    )
