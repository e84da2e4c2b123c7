"""The smallest size that would have been seen: whatever shape the effect has."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.detectable import smallest_detectable
from estimator.effects import Place, effect

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def scores(make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]) -> Scores:
    """Of two joints and nothing hidden."""
    body = make_chain("rr")
    evidence = gather(body, play_twice(body), 0.05)
    return Scores(evidence.design, evidence.blocks, evidence.folds)


def told_by_shape(scores: Scores, name: str, joint: int) -> list[tuple[Array, float]]:
    """Of each shape of an effect, its theta and the coefficient that is one standard error, as the links bend."""
    found = []
    for k, candidate in enumerate(scores.design.candidates):
        hypothesis = scores.hypothesis(k)
        if (hypothesis.effect.name, hypothesis.place.joint) == (name, joint):
            matrix, _, _ = scores.model([]).left_of(candidate.columns[:1])
            found.append((candidate.theta, float(1.0 / np.sqrt(matrix[0, 0]))))
    return found


def errors_told(scores: Scores, joint: int) -> float:
    """Standard errors that an effect must be large: told of a law of one shape."""
    sizes, _ = smallest_detectable(scores, [])
    ((_, error),) = told_by_shape(scores, "viscous_friction", joint)
    return sizes["viscous_friction"][joint] / error


@pytest.mark.parametrize("joint", [0, 1])
def test_a_spring_that_would_have_been_seen_is_as_soft_as_its_faintest_shape(scores: Scores, joint: int) -> None:
    """Of a stiffness, which is endless where there is no elasticity, the smallest value is the largest effect."""
    sizes, units = smallest_detectable(scores, [])
    law, place = effect("joint_elasticity"), Place(joint)
    softest = min(
        float(law.parameters(place, theta, np.array([error]))["stiffness"])
        for theta, error in told_by_shape(scores, "joint_elasticity", joint)
    )
    assert units["joint_elasticity"] == "N·m/rad"
    assert sizes["joint_elasticity"][joint] == pytest.approx(softest / errors_told(scores, joint))


@pytest.mark.parametrize("joint", [0, 1])
def test_a_level_that_would_have_been_seen_is_that_of_its_faintest_shape(scores: Scores, joint: int) -> None:
    sizes, _ = smallest_detectable(scores, [])
    faintest = max(error for _, error in told_by_shape(scores, "coulomb_friction", joint))
    assert sizes["coulomb_friction"][joint] == pytest.approx(faintest * errors_told(scores, joint))
