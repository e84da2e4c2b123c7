"""Noise in the motion, priors, efficiency, and memory."""

from __future__ import annotations

import tracemalloc
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import LinkOptions, RigidBody, Trajectory, identify_links, inverse_dynamics, torque_regressor
from estimator.consistency import prior_precision
from estimator.links import Prior

Array = NDArray[np.float64]
Motion = Callable[..., tuple[Array, ...]]


def recordings(
    body: RigidBody, make_periodic: Motion, seed: int, velocity_noise: float, angle_noise: float = 0.0
) -> list[Trajectory]:
    random = np.random.default_rng(seed)
    result = []
    for motion in (5, 6):
        t, q, dq, ddq = make_periodic(body.n, 10.0, 200.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + 0.5 * random.normal(size=q.shape)
        seen = dq + velocity_noise * random.normal(size=q.shape)
        result.append(Trajectory(t, q + angle_noise * random.normal(size=q.shape), tau, seen, q_desired=q))
    return result


def test_instruments_remove_the_bias_of_noisy_motion(dda: RigidBody, make_periodic: Motion) -> None:
    deviations = {"weighted": [], "instrumental_variables": []}
    for seed in range(12):
        data = recordings(dda, make_periodic, seed, velocity_noise=0.2, angle_noise=1e-3)
        for estimator, found in deviations.items():
            result = identify_links(dda, data, LinkOptions(estimator=estimator, terms=()))
            found.append(result.beta - result.base.combination @ dda.prior())
    bias = {name: np.abs(np.mean(rows, axis=0)) for name, rows in deviations.items()}
    chance = np.std(deviations["instrumental_variables"], axis=0) / np.sqrt(12)
    assert np.max(bias["weighted"] / chance) > 10.0
    assert np.max(bias["instrumental_variables"] / chance) < 5.0


def test_hausman_tells_whether_noise_in_the_motion_matters(dda: RigidBody, make_periodic: Motion) -> None:
    options = LinkOptions(estimator="instrumental_variables", terms=())

    def p_value(seed: int, noise: float) -> float:
        data = recordings(dda, make_periodic, seed, noise, 0.05 * noise)
        return float(identify_links(dda, data, options).tests["durbin_wu_hausman"]["p_value"])

    assert sum(p_value(seed, 0.2) < 0.01 for seed in range(5)) == 5
    assert sum(p_value(seed, 1e-4) < 0.01 for seed in range(10)) <= 1


def test_prior_fills_in_what_the_motion_does_not_tell(dda: RigidBody) -> None:
    t = np.arange(6000) / 1000.0
    w = np.array([0.0, 2.1, 3.3])
    q = 1.0 + np.sin(w * t[:, None])
    dq, ddq = w * np.cos(w * t[:, None]), -(w**2) * np.sin(w * t[:, None])
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq) + 0.1 * np.random.default_rng(0).normal(size=q.shape)
    found = identify_links(dda, [Trajectory(t, q, tau, dq)], LinkOptions(terms=()), prior=Prior(dda.prior(), 0.2))
    assert found.status == "identified"
    assert any("the prior's" in warning for warning in found.warnings)
    truth = found.base.combination @ dda.prior()
    assert np.isfinite(found.standard_error).all()
    assert np.abs((found.beta - truth) / found.standard_error).max() < 5.0
    # The first joint never moved: its inertia is known no better than beforehand.
    assert found.standard_error[0] > 0.02 * truth[0]


def test_plentiful_data_outweigh_a_wrong_prior(dda: RigidBody, make_periodic: Motion) -> None:
    data = recordings(dda, make_periodic, 3, 0.0)
    wrong = Prior(1.5 * dda.prior(), 0.3)
    found = identify_links(dda, data, LinkOptions(terms=()), prior=wrong)
    truth = found.base.combination @ dda.prior()
    assert np.abs(found.beta - truth).max() < 0.02 * np.abs(truth).max()


def test_a_prior_believes_the_mass_within_its_tolerance(dda: RigidBody) -> None:
    spread = np.linalg.inv(prior_precision(dda.prior(), 0.2))
    for link in range(3):
        mass = dda.prior()[10 * link]
        assert np.sqrt(spread[10 * link, 10 * link]) == pytest.approx(0.2 * mass, rel=0.01)
    with pytest.raises(InputError, match="link 1 has no mass"):
        prior_precision(np.zeros(30), 0.2)


def test_error_is_near_the_cramer_rao_bound(dda: RigidBody, make_periodic: Motion) -> None:
    """White torque noise: the band-limited, decimated estimate against the bound of all samples at full rate."""
    found, base = [], None
    for seed in range(80):
        result = identify_links(dda, recordings(dda, make_periodic, seed, 0.0), LinkOptions(terms=()))
        base = result.base
        found.append(result.beta)
    information = np.zeros((15, 15))
    assert base is not None
    for motion in (5, 6):
        _, q, dq, ddq = make_periodic(3, 10.0, 200.0, motion)
        rows = base.select(torque_regressor(dda, q, dq, ddq)).reshape(-1, 15)
        information += rows.T @ rows / 0.5**2
    bound = np.sqrt(np.diag(np.linalg.inv(information)))
    ratio = np.std(found, axis=0, ddof=1) / bound
    # The bound is for 20 s, of which half a second is lost at the ends; 80 runs tell a ratio to 8 %.
    assert 0.95 < np.sqrt(np.mean(ratio**2)) < 1.1


def test_a_million_samples_need_less_than_60_megabytes(dda: RigidBody, make_periodic: Motion) -> None:
    def peak(repeats: int) -> int:
        t, q, dq, ddq = make_periodic(3, 20.0, 1000.0, 5)
        tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
        long = Trajectory(np.arange(repeats * len(t)) / 1000.0, *(np.tile(x, (repeats, 1)) for x in (q, tau, dq)))
        tracemalloc.start()
        identify_links(dda, [long], LinkOptions(band_hz=10.0))
        size = tracemalloc.get_traced_memory()[1]
        tracemalloc.stop()
        return size

    short, long = peak(5), peak(15)
    # What grows is the list of whole samples and the check of their times; the rows themselves need none.
    assert (long - short) / 200_000 < 32.0
    assert long + 700_000 * (long - short) / 200_000 < 60e6
