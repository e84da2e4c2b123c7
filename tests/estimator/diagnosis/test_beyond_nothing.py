"""What is hardly different from nothing at the shape that fits best has no name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from estimator import RigidBody, Trajectory
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.judging import _beyond_nothing, _refined
from estimator.diagnosis.naming.plainer import fitted


def test_a_cause_within_three_standard_errors_of_nothing_falls(
    make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]
) -> None:
    """Where a joint rubs and nothing else, a play of its neighbour is no cause at the shape that fits best."""
    body = make_chain("rr")
    played = play_twice(body, lambda q, dq: np.array([0.5, 0.0]) * np.tanh(dq / 0.01))
    evidence = gather(body, played, 0.02)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)

    def best(effect: str, joint: int, beside: list[int]) -> int:
        laws = [scores.hypothesis(k) for k in range(len(scores.owner))]
        there = [k for k, law in enumerate(laws) if law.effect.name == effect and law.place.joint == joint]
        return max(there, key=lambda k: float(scores.gains(beside)[k]))

    friction = best("coulomb_friction", 0, [])
    play = best("backlash", 1, [friction])
    shaped = fitted(evidence, scores, [friction, play])
    number = [scores.owner[k] for k in (friction, play)].index(scores.owner[play])
    assert 1.0 < _beyond_nothing(shaped, number) < 3.0
    assert _refined(evidence, scores, [friction, play])[0] == [friction]
