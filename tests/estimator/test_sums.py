"""Sums: the same whichever way they are added up, bounded in number, and as good as the rows for whitening."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.sums import LAGS, Sums
from estimator.whitening import white_weight, whitening_weight

Array = NDArray[np.float64]


def segments(count: int, rows: int, seed: int = 0) -> list[list[Array]]:
    random = np.random.default_rng(seed)
    return [[random.normal(size=(4, rows)), random.normal(size=(3, rows))] for _ in range(count)]


def total(sums: Sums) -> list[Array]:
    return [np.sum([batch.lagged[joint] for batch in sums.batches], axis=0) for joint in range(2)]


def test_batches_add_up_to_the_gram_matrix() -> None:
    data = segments(3, 200)
    sums = Sums()
    for k, rows in enumerate(data):
        sums.add(rows, k)
    assert len(sums.batches) > 10
    assert sums.rows == 600
    np.testing.assert_allclose(total(sums)[0][0], sum(x[0] @ x[0].T for x in data), rtol=1e-10)
    np.testing.assert_allclose(
        total(sums)[1][2], sum(x[1][:, :-2] @ x[1][:, 2:].T + x[1][:, 2:] @ x[1][:, :-2].T for x in data), atol=1e-9
    )


def test_order_of_recordings_does_not_matter() -> None:
    data = segments(6, 100)
    forward, backward, one_by_one = Sums(), Sums(), Sums()
    for k, rows in enumerate(data):
        forward.add(rows, k)
        backward.add(data[-1 - k], k)
        single = Sums()
        single.add(rows, 0)
        one_by_one.merge(single)
    for other in (backward, one_by_one):
        assert other.rows == forward.rows
        for mine, theirs in zip(total(forward), total(other), strict=True):
            np.testing.assert_allclose(mine, theirs, atol=1e-9)


def test_batches_stay_bounded_however_long_the_recording() -> None:
    sums = Sums()
    for rows in segments(60, 150):
        sums.add(rows, 0)
    assert len(sums.batches) <= 40
    sizes = [batch.rows for batch in sums.batches]
    assert sum(sizes) == 9000
    assert max(sizes) <= 4 * min(sizes)


def test_lagged_sums_whiten_as_filtering_the_rows_would() -> None:
    rows = segments(1, 400)[0]
    sums = Sums()
    sums.add(rows, 0)
    a = np.array([1.0, -0.6, 0.25])
    filtered = np.array([np.convolve(x, a) for x in rows[0]])
    weight = np.zeros(LAGS)
    weight[:3] = [a @ a, a[:2] @ a[1:], a[0] * a[2]]
    np.testing.assert_allclose(np.tensordot(weight, total(sums)[0], 1), filtered @ filtered.T, atol=1e-9)


def test_whitening_finds_the_inverse_spectrum_of_autoregressive_noise() -> None:
    a1, a2, variance = -0.9, 0.3, 2.0
    random = np.random.default_rng(8)
    noise = np.zeros(200_000)
    drive = random.normal(0.0, np.sqrt(variance), noise.size)
    for k in range(2, noise.size):
        noise[k] = -a1 * noise[k - 1] - a2 * noise[k - 2] + drive[k]
    covariance = np.array([np.mean(noise[lag:] * noise[: noise.size - lag]) for lag in range(LAGS)])
    weight = whitening_weight(covariance, noise.size)
    expected = np.array([1 + a1**2 + a2**2, a1 + a1 * a2, a2, 0.0, 0.0]) / variance
    np.testing.assert_allclose(weight, expected, atol=0.01)


@pytest.mark.parametrize("rows", [10, 39])
def test_few_rows_are_taken_as_white(rows: int) -> None:
    np.testing.assert_array_equal(whitening_weight(np.array([4.0, 3.0, 2.0, 1.0, 0.5]), rows), white_weight(4.0))
