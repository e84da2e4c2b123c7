"""Section 7.2: a point is hit at a time after a few throws."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from learner.task_level import TaskLearner

Array = NDArray[np.float64]
WANTED = np.array([1.2, 0.9])


def tool(q: Array, second: float = 1.0, bend: float = 0.0) -> Array:
    """Where a planar two-link arm's tool is; the true arm's second link is longer, and gravity bends it."""
    a, b = q[0] + bend * np.cos(q[0]), q[0] + q[1] + bend * np.cos(q[0] + q[1])
    return np.array([np.cos(a) + second * np.cos(b), np.sin(a) + second * np.sin(b)])


def throws(start: Array, scatter: float, seed: int) -> list[float]:
    rng = np.random.default_rng(seed)
    learner = TaskLearner(tool, start, WANTED, np.full(2, scatter), reach=np.full(2, 0.3))
    misses = []
    for _ in range(8):
        true = tool(learner.parameters, second=1.08, bend=-0.1)
        misses.append(float(np.linalg.norm(true - WANTED)))
        if learner.take(true + scatter * rng.standard_normal(2)):
            break
    return misses


def test_the_model_and_the_misses_find_the_aim() -> None:
    misses = throws(np.array([0.3, 0.7]), scatter=1e-4, seed=1)
    assert misses[0] > 0.1
    assert misses[-1] < 5e-4
    assert len(misses) <= 6


def test_a_miss_within_chance_teaches_nothing() -> None:
    learner = TaskLearner(tool, np.array([0.3, 0.7]), tool(np.array([0.3, 0.7])), np.full(2, 0.01), np.full(2, 0.3))
    before = learner.parameters.copy()
    assert learner.take(tool(before) + 0.015)
    np.testing.assert_array_equal(learner.parameters, before)


def test_one_step_is_no_longer_than_the_reach() -> None:
    learner = TaskLearner(tool, np.array([0.3, 0.7]), WANTED, np.full(2, 1e-4), reach=np.full(2, 0.05))
    before = learner.parameters.copy()
    assert not learner.take(tool(before) + 1.0)
    assert np.abs(learner.parameters - before).max() <= 0.05 + 1e-12
