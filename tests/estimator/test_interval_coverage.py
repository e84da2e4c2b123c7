"""Do 95 % intervals hold the truth 95 times in a hundred? Noise on every channel."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from scipy.signal import lfilter

from estimator import LinkOptions, RigidBody, Trajectory, identify_links, inverse_dynamics

RUNS = 60


@pytest.mark.parametrize(
    ("colour", "velocity_noise", "estimator"),
    [
        (0.0, 2e-3, "weighted"),
        (0.9, 2e-3, "weighted"),
        (0.9, 2e-3, "whitened"),
        (0.0, None, "weighted"),
        (0.0, 2e-2, "instrumental_variables"),
        (0.9, 5e-2, "optimal_filter"),
    ],
)
def test_intervals_hold_the_truth(
    dda: RigidBody,
    make_periodic: Callable[..., tuple[np.ndarray, ...]],
    colour: float,
    velocity_noise: float | None,
    estimator: str,
) -> None:
    motions = [make_periodic(3, 10.0, 200.0, seed) for seed in (5, 6)]
    clean = [
        inverse_dynamics(dda, dda.prior(), q, dq, ddq) + np.array([2.0, 1.0, 0.8]) * np.tanh(dq / 0.02)
        for _, q, dq, ddq in motions
    ]
    options = LinkOptions(estimator=estimator, terms=("viscous_friction", "coulomb_friction"))
    inside: list[np.ndarray] = []
    for run in range(RUNS):
        random = np.random.default_rng(run)
        recordings = []
        for (t, q, dq, _), tau in zip(motions, clean, strict=True):
            noise = random.normal(size=tau.shape)
            noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], noise, axis=0)
            recordings.append(
                Trajectory(
                    t,
                    q + 1e-5 * random.normal(size=q.shape),
                    tau + np.array([1.0, 0.5, 0.3]) * noise,
                    None if velocity_noise is None else dq + velocity_noise * random.normal(size=q.shape),
                    q_desired=q,
                )
            )
        found = identify_links(dda, recordings, options)
        low, high = found.interval(0.95)[:15].T
        truth = found.base.combination @ dda.prior()
        inside.append((low < truth) & (truth < high))
    # Promised are 93 to 97 %. The fifteen looks of one run are not independent: the runs' own scatter says by how much
    # the mean may miss that by chance (once in a hundred).
    each = np.mean(inside, axis=1)
    chance = 2.58 * np.std(each, ddof=1) / np.sqrt(RUNS)
    assert chance < 0.03
    assert 0.93 - chance < np.mean(each) < 0.97 + chance
