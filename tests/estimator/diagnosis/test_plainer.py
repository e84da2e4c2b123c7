"""Plainer laws in the place of one that mended their form: what had fallen beside that has its name again."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.judging import _beside_what_was_told
from estimator.diagnosis.naming.plainer import _with_what_fell, fitted, not_taken_back
from estimator.diagnosis.naming.search import Search

Array = NDArray[np.float64]
RUBS = ("coulomb_friction", 0), ("viscous_friction", 0), ("coulomb_friction", 1), ("viscous_friction", 1)


@pytest.fixture(scope="module")
def evidence(make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]) -> Evidence:
    """Of an arm whose first two joints rub, both with a little viscous friction beside the dry one."""
    body, rubs = make_chain("rrr"), np.array([1.0, 1.0, 0.0])
    return gather(body, play_twice(body, lambda q, dq: rubs * (1.5 * np.tanh(dq / 0.01) + 0.3 * dq)), 0.02)


@pytest.fixture(scope="module")
def search(evidence: Evidence) -> Search:
    return Search(Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news))


def best(search: Search, effect: str, joint: int, beside: list[int]) -> int:
    """The best supported candidate of an effect of a joint beside others."""
    gains = search.scores.gains(beside)
    own = [
        k
        for k in range(len(search.scores.owner))
        if (h := search.scores.hypothesis(k)).effect.name == effect and h.place.joint == joint and h.place.other is None
    ]
    return max(own, key=lambda k: float(gains[k]))


@pytest.fixture(scope="module")
def causes(search: Search) -> dict[tuple[str, int], int]:
    chosen: list[int] = []
    for effect, joint in RUBS:
        chosen.append(best(search, effect, joint, chosen))
    search.scores.reweigh(chosen)
    return dict(zip(RUBS, chosen, strict=True))


def test_a_viscous_friction_that_fell_beside_bristles_is_told_beside_coulombs(
    evidence: Evidence, search: Search, causes: dict[tuple[str, int], int]
) -> None:
    """Of the joints that have it, and of the third, which rubs in no way, none."""
    plainer = search.ordered([causes["coulomb_friction", 0], causes["coulomb_friction", 1]])
    refined = fitted(evidence, search.scores, plainer)
    told, shaped = _with_what_fell(evidence, search, plainer, refined)
    assert set(told) == set(causes.values())
    assert shaped.explained > refined.explained + 10.0
    assert _with_what_fell(evidence, search, told, shaped) == (told, shaped)


def test_a_law_that_no_wider_one_has_beside_it_is_not_asked_again(
    evidence: Evidence, search: Search, causes: dict[tuple[str, int], int]
) -> None:
    bristles = [causes["coulomb_friction", 0], causes["viscous_friction", 0], best(search, "presliding", 1, [])]
    refined = fitted(evidence, search.scores, bristles)
    assert _with_what_fell(evidence, search, bristles, refined) == (bristles, refined)


def test_what_was_told_beside_what_stands_is_not_told_as_unexplained_too(
    evidence: Evidence, search: Search, causes: dict[tuple[str, int], int]
) -> None:
    stood = search.ordered([causes["coulomb_friction", 0], best(search, "presliding", 1, [])])
    refined = fitted(evidence, search.scores, stood)
    told = [causes[own] for own in (("coulomb_friction", 0), ("coulomb_friction", 1), ("viscous_friction", 1))]
    beside, shaped = _beside_what_was_told(evidence, search.scores, stood, refined, told)
    assert set(beside) == {*stood, causes["viscous_friction", 1]}, "presliding contains Coulomb's friction"
    assert shaped.explained > refined.explained
    assert _beside_what_was_told(evidence, search.scores, stood, refined, stood) == (stood, refined)


def test_an_offset_that_takes_back_an_asymmetry_is_told_with_it_as_the_friction_that_both_leave(
    make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]
) -> None:
    """A torque that is less at rest than in motion, whichever way, is half of the difference of two levels less its
    own: neither is there. Both are told where they do not take each other back."""
    body, rubs = make_chain("rrr"), np.array([1.0, 0.0, 0.0])

    def names(offset: float) -> set[str]:
        def law(q: Array, dq: Array) -> Array:
            sign = np.tanh(dq / 0.01)
            return np.asarray(rubs * (1.5 * sign + 0.3 * dq + 0.12 * np.abs(sign) + offset))

        evidence = gather(body, play_twice(body, law), 0.02)
        scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)
        search, chosen = Search(scores), list[int]()
        for effect in ("asymmetric_friction", "torque_offset"):
            chosen.append(best(search, effect, 0, chosen))
        told, _ = not_taken_back(evidence, scores, chosen, fitted(evidence, scores, chosen))
        return {scores.hypothesis(k).effect.name for k in told}

    assert names(-0.12) == {"coulomb_friction", "viscous_friction"}
    assert names(0.2) == {"asymmetric_friction", "torque_offset"}
