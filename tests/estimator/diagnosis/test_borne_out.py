"""Whether what was left out bears a cause out: over whole motions, and over parts where one of them shows it alone."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.evidence.borne_out import BORNE_OUT, in_errors, one_shows
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import Admission


@pytest.mark.parametrize(
    ("gains", "borne_out"),
    [
        ([5.0, 6.0, 4.0], True),
        ([2.0, 8.0, 3.0, 4.0, 230.0], True),
        ([0.2, -3.0, 0.5, 1.0, 230.0], False),
        ([4.0, 3.0, 230.0], True),
        ([296.0, 53.0, 20831.0, 40.0], True),
        ([-0.1, 8.6, 948.0, 2.1], False),
        ([-0.5, 0.4, 0.3, 948.0], False),
        ([1000.0, 800.0, 600.0, -12.0], True),
        ([-1.0, 2.0, -2.0, 1.0], False),
        ([0.0, 420.0, 0.0, 0.1, 1900.0, 0.0, 550.0, 0.0, 0.0], True),
        ([0.0, 420.0, 0.0, 0.1, 1900.0, 0.0, -350.0, 0.0, 0.0], False),
        ([0.0, 0.0, 0.0, 0.1, 1900.0, 0.0, 0.0, 0.0, 0.0], False),
        ([0.0, 420.0, 0.0, 0.1, 1900.0, 0.0, 0.0, 0.0, 0.0], False),
    ],
)
def test_the_others_bear_out_what_one_motion_shows_most_of(gains: list[float], borne_out: bool) -> None:
    """A motion that was designed to decide outweighs all others, and by itself bears nothing out; parts in which a
    joint stands still say nothing of its friction, and are no scatter of what the others say."""
    assert (in_errors(np.array(gains)) > BORNE_OUT) is borne_out


@pytest.mark.parametrize(
    ("gains", "alone"),
    [
        ([0.2, -1.0, 0.5, 0.1, 230.0], True),
        ([0.2, -8.0, 0.5, 0.1, 230.0], False),
        ([3.0, 1.0, 5.0, 2.0, 8.0], False),
        ([-0.2, -0.1, -0.5], False),
    ],
)
def test_one_motion_shows_a_cause_that_the_others_do_not_speak_against(gains: list[float], alone: bool) -> None:
    assert one_shows(np.array(gains)) is alone


@pytest.fixture(scope="module")
def evidence(make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[np.ndarray, ...]]) -> Evidence:
    """Of five motions, of which the last alone turns the second joint, which rubs; each played twice."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in range(5):
        t, q, dq, ddq = make_periodic(2, 6.0, 200.0, motion)
        if motion < 4:
            q[:, 1], dq[:, 1], ddq[:, 1] = 0.2 * motion, 0.0, 0.0
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 1] += 0.1 * np.tanh(dq[:, 1] / 0.01)
        recordings += [Trajectory(t, q, tau + 0.2 * random.normal(size=q.shape)) for _ in range(2)]
    return gather(body, recordings, 0.02)


def friction_of_the_second(scores: Scores, effect: str) -> int:
    own = [
        k
        for k in range(len(scores.owner))
        if (h := scores.hypothesis(k)).effect.name == effect and h.place.joint == 1 and h.place.other is None
    ]
    return max(own, key=lambda k: float(scores.gains([])[k]))


def test_what_one_motion_shows_alone_is_borne_out_by_its_parts(evidence: Evidence) -> None:
    by_parts = Scores(evidence.design, evidence.blocks, evidence.folds)
    whole = Scores(evidence.design, evidence.blocks, replace(evidence.folds, parts=()))
    coulomb = friction_of_the_second(by_parts, "coulomb_friction")
    assert by_parts.held_out(coulomb, []) > BORNE_OUT
    assert whole.held_out(coulomb, []) < BORNE_OUT, "whole motions bear it out, and nothing is tested"


def test_a_dry_friction_recurs_by_half_and_others_by_three_quarters(
    evidence: Evidence, monkeypatch: pytest.MonkeyPatch
) -> None:
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    admission = Admission(scores)
    recurs = {}
    for share in (0.4, 0.6, 0.8):
        monkeypatch.setattr(scores, "recurring", lambda candidate, others, share=share: share)
        recurs[share] = [
            admission.recurs(friction_of_the_second(scores, effect), [])
            for effect in ("coulomb_friction", "viscous_friction")
        ]
    assert recurs == {0.4: [False, False], 0.6: [True, False], 0.8: [True, True]}
