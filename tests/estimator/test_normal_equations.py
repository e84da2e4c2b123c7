"""Errors from how batches disagree, and how many degrees of freedom stand behind them."""

from __future__ import annotations

import numpy as np
import pytest
from scipy.stats import t as student

from estimator.normal_equations import NormalEquations, solve


def means_of(weights: np.ndarray, right: np.ndarray) -> NormalEquations:
    """One unknown, the mean: batches that tell it with these weights."""
    return NormalEquations(weights[:, None, None], right[:, None], np.zeros((1, 1)), np.zeros(1))


def test_of_alike_batches_one_degree_of_freedom_is_the_mean() -> None:
    values = np.random.default_rng(0).normal(size=12)
    found = solve(means_of(np.ones(12), values))
    assert found.degrees_of_freedom == pytest.approx([11.0])
    assert found.covariance[0, 0] == pytest.approx(np.var(values, ddof=1) / 12.0)


def test_what_few_batches_tell_has_few_degrees_of_freedom() -> None:
    """Two of twenty batches say nearly all: the error has hardly more than the one degree of freedom between them."""
    weights = np.array([100.0, 100.0, *np.ones(18)])
    found = solve(means_of(weights, np.zeros(20)))
    assert 1.0 < found.degrees_of_freedom[0] < 1.5


def test_student_with_these_degrees_of_freedom_holds_where_batches_differ_in_weight() -> None:
    """Three of twenty batches tell half. (Where two tell nearly all, the intervals are too wide, never too narrow.)"""
    random = np.random.default_rng(1)
    weights = np.array([6.0, 5.0, 4.0, *np.ones(17)])
    held = []
    for _ in range(2000):
        found = solve(means_of(weights, np.sqrt(weights) * random.normal(size=20)))
        half = student.ppf(0.975, found.degrees_of_freedom[0]) * np.sqrt(found.covariance[0, 0])
        held.append(abs(found.value[0]) < half)
    assert np.mean(held) == pytest.approx(0.95, abs=0.01 + 2.58 * np.sqrt(0.95 * 0.05 / 2000))


def test_below_four_batches_nothing_is_said() -> None:
    found = solve(means_of(np.ones(3), np.zeros(3)))
    assert np.isinf(found.covariance[0, 0])
    assert not found.degrees_of_freedom.any()
