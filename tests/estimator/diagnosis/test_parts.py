"""Parts of the diagnosis by known answers: noise that playings share, limited fits, chance, maps."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import lsq_linear

from estimator import Trajectory
from estimator.diagnosis.evidence.bounded import bounded_gains
from estimator.diagnosis.evidence.maps import hats
from estimator.diagnosis.observed.grains import counts, repeated_white
from estimator.diagnosis.observed.noise import ORDER, autocovariance, autoregressive, whitened_variance
from estimator.diagnosis.observed.repetition import repeated_noise
from estimator.repeats import find_repeats

Array = NDArray[np.float64]


def test_limited_fits_are_those_of_a_solver_made_for_them() -> None:
    random = np.random.default_rng(0)
    columns = random.normal(size=(40, 60, 3)) + 0.7 * random.normal(size=(40, 60, 1))
    right = random.normal(size=(40, 60))
    matrix, score = np.einsum("knc,knd->kcd", columns, columns), np.einsum("knc,kn->kc", columns, right)
    lower, upper = np.tile([0.0, -np.inf, 0.0], (40, 1)), np.full((40, 3), np.inf)
    energy = np.einsum("kcc->kc", matrix)
    gain = bounded_gains(matrix, score[:, :, None], energy, lower, upper)
    for k in range(40):
        best = lsq_linear(columns[k], right[k], (lower[k], upper[k]), tol=1e-12)
        np.testing.assert_allclose(gain[k, 0], 0.5 * np.sum(right[k] ** 2) - best.cost, atol=1e-6)


def test_what_is_left_of_a_column_by_rounding_is_not_fitted() -> None:
    matrix = np.diag([1.0, 1e-14])[None]
    free = np.full((1, 2), np.inf)
    gain = bounded_gains(matrix, np.ones((1, 2, 1)), np.ones((1, 2)), -free, free)
    np.testing.assert_allclose(gain, 0.5, atol=1e-9)


def test_an_encoders_count_is_read_off_its_angles() -> None:
    t = np.arange(2000) / 250.0
    q = np.column_stack([np.sin(t), np.sin(1.3 * t), np.sin(0.7 * t)])
    count = np.array([1e-4, 2.5e-4, 0.0])
    q[:, :2] = np.round(q[:, :2] / count[:2]) * count[:2]
    found = counts([Trajectory(t, q, np.zeros_like(q))])
    np.testing.assert_allclose(found, count, rtol=1e-6)


def test_white_error_that_both_playings_have_is_told_from_noise_of_each() -> None:
    random = np.random.default_rng(1)
    t = np.arange(5000) / 250.0
    q = np.column_stack([np.sin(1.1 * t) + 0.3 * np.sin(2.9 * t), np.cos(0.9 * t)])
    common = random.normal(size=q.shape) * [0.3, 0.0]
    playings = [
        Trajectory(t, q + 1e-6 * random.normal(size=q.shape), q + common + 0.2 * random.normal(size=q.shape))
        for _ in range(2)
    ]
    found = repeated_white(playings, find_repeats(playings), [p.tau for p in playings], 10.0)
    np.testing.assert_allclose(found, [0.09, 0.0], atol=0.01)


def test_whitened_noise_is_white_with_unit_variance() -> None:
    random = np.random.default_rng(2)
    white = random.normal(size=(20_000, 1))
    coloured = np.empty_like(white)
    coloured[0] = white[0]
    for k in range(1, len(white)):
        coloured[k] = 0.7 * coloured[k - 1] + 2.0 * white[k]
    taps = autoregressive(autocovariance([coloured])[0], len(coloured))
    whitened = np.convolve(coloured[:, 0], taps, mode="valid")
    assert len(taps) == ORDER + 1
    assert abs(whitened.var() - 1.0) < 0.05
    assert abs(np.corrcoef(whitened[1:], whitened[:-1])[0, 1]) < 0.03


def test_the_part_of_a_noise_that_is_left_by_its_whitening_filter() -> None:
    random = np.random.default_rng(4)
    taps = random.normal(size=(2, ORDER + 1))
    error = np.convolve(random.normal(size=50_000), [1.0, 0.5, -0.3], mode="valid")
    covariance = np.tile(autocovariance([error[:, None]])[0], (2, 1))
    filtered = [np.convolve(error, own, mode="valid").var() for own in taps]
    np.testing.assert_allclose(whitened_variance(taps, covariance), filtered, rtol=0.02)


def test_errors_that_all_playings_have_in_common_are_told_once() -> None:
    """What a projection on one column scatters by is what the rows are said to tell."""
    random = np.random.default_rng(5)
    motions, count, shared, own = 200, 3, 0.3, 0.2
    common = shared * random.normal(size=(motions, 1, 80, 1))
    rows = common + own * random.normal(size=(motions, count, 80, 1))
    unseen = np.zeros((1, ORDER + 1))
    unseen[0, 0] = shared**2
    noise = repeated_noise(list(rows[:, None]), unseen, np.zeros_like(unseen))
    alone = repeated_noise(list((rows - common)[:, None]), *np.zeros((2, *unseen.shape)))
    assert noise is not None and alone is not None
    np.testing.assert_allclose(alone.news, 1.0)
    column = random.normal(size=80)
    products = (rows[..., 0] @ column).sum(axis=1) * noise.filters[0, 0]
    np.testing.assert_allclose(count * (column @ column) / np.var(products), noise.news[0], rtol=0.25)


def test_a_map_interpolates_and_holds_its_ends() -> None:
    knots = np.linspace(-1.0, 1.0, 5)
    x = np.array([-3.0, -1.0, -0.25, 0.6, 2.0])
    weights = hats(x, knots)
    np.testing.assert_allclose(weights.sum(axis=1), 1.0)
    np.testing.assert_allclose(weights @ knots, np.clip(x, -1.0, 1.0))
    assert all(0.0 <= weights[i, j] <= 1.0 for i, j in product(range(5), range(5)))
