"""A line between the orders of the grid, far above the noise, and lines that stand in its place."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.one_line import of_one_line

Array = NDArray[np.float64]
Play = Callable[..., list[Trajectory]]
FIRST = np.array([1.0, 0.0])


def gathered(body: RigidBody, play_twice: Play, orders: tuple[float, ...]) -> tuple[Evidence, Scores]:
    """Of a joint that cogs at these orders."""

    def law(q: Array, dq: Array) -> Array:
        return FIRST * sum(3.0 * np.sin(order * q[:, [0]] + 0.3) for order in orders)

    evidence = gather(body, play_twice(body, law, noise=0.02), 0.05)
    return evidence, Scores(evidence.design, evidence.blocks, evidence.folds)


def candidates(scores: Scores, effect: str, near: float, count: int) -> list[int]:
    """Lines of the first joint's grid, the nearest to an order first."""
    own = [
        k for k in range(len(scores.owner)) if (h := scores.hypothesis(k)).effect.name == effect and h.place.joint == 0
    ]
    return sorted(own, key=lambda k: abs(float(scores.design.candidates[k].theta[0]) - near))[:count]


@pytest.mark.parametrize("other", ["cogging", "torque_ripple"])
def test_neighbours_that_mend_a_line_on_the_grid_are_none_at_its_best_shape(
    make_chain: Callable[..., RigidBody], play_twice: Play, other: str
) -> None:
    evidence, scores = gathered(make_chain("rr"), play_twice, (9.7,))
    first, second, *_ = candidates(scores, "cogging", 9.7, 2)
    crowd = [first, second if other == "cogging" else candidates(scores, other, 9.7, 1)[0]]
    chosen, refined = of_one_line(evidence, scores, crowd, fitted(evidence, scores, crowd))
    assert [scores.hypothesis(k).effect.name for k in chosen] == ["cogging"]
    assert float(refined.design.candidates[0].theta[0]) == pytest.approx(9.7, abs=0.02)
    assert np.hypot(*refined.coefficients(0)) == pytest.approx(3.0, rel=0.02)


def test_two_lines_that_are_there_stay_two(make_chain: Callable[..., RigidBody], play_twice: Play) -> None:
    """As near as the range of the joint resolves, and nearer: one alone leaves far more than a form does."""
    evidence, scores = gathered(make_chain("rr"), play_twice, (9.3, 10.5))
    pair = [candidates(scores, "cogging", order, 1)[0] for order in (9.3, 10.5)]
    chosen, refined = of_one_line(evidence, scores, pair, fitted(evidence, scores, pair))
    assert set(chosen) == set(pair)
    orders = sorted(float(c.theta[0]) for c in refined.design.candidates)
    assert orders == pytest.approx([9.3, 10.5], abs=0.05)
