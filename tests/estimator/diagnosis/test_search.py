"""The search for causes: it ends, and what it remembers is what it would work out again."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming import causes, judging, sharpening
from estimator.diagnosis.naming.accuracy import Searched, searched
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.causes import judged
from estimator.diagnosis.naming.plainer import fitted, simpler
from estimator.diagnosis.naming.rivals import AMBIGUOUS, Alternative
from estimator.diagnosis.naming.search import Search

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def record(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> Callable[[float], Evidence]:
    """Of two joints with friction, and so much more of it one way, each of three motions played twice."""

    def make(one_way: float) -> Evidence:
        body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
            friction = 0.8 * np.sign(dq) + 0.5 * dq + one_way * np.maximum(dq, 0.0)
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + friction
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + 0.2 * random.normal(size=q.shape)))
        return gather(body, recordings, 0.05)

    return make


@pytest.fixture(scope="module")
def evidence(record: Callable[[float], Evidence]) -> Evidence:
    return record(0.0)


@pytest.fixture
def scores(evidence: Evidence) -> Scores:
    return Scores(evidence.design, evidence.blocks, evidence.folds)


def test_a_few_candidates_gain_what_they_gain_among_all(scores: Scores) -> None:
    best = [row[0] for row in scores.ranked([])[:2]]
    few = [k for k in range(0, len(scores.owner), 7) if k not in best]
    alone = scores.gains_of(few, best)
    np.testing.assert_allclose(alone[few], scores.gains(best)[few], rtol=1e-6, atol=1e-6)
    assert not np.isfinite(np.delete(alone, few)).any()


def test_a_cause_that_is_taken_out_again_is_not_tried_for_ever(scores: Scores, monkeypatch: pytest.MonkeyPatch) -> None:
    def nothing(_: Search, chosen: Sequence[int]) -> list[int]:
        return []

    monkeypatch.setattr(Search, "pruned", nothing)
    assert Search(scores).run() == []


@pytest.mark.parametrize("driven", [0, 1])
def test_of_two_causes_of_which_one_drives_the_other_beyond_its_limits_the_better_supported_stays(
    scores: Scores, monkeypatch: pytest.MonkeyPatch, driven: int
) -> None:
    """A drifting friction beside one that does not drift takes what is not there of it."""

    def best(effect: str, joint: int) -> int:
        gains = scores.gains([])
        places = [(scores.hypothesis(k).effect.name, scores.hypothesis(k).place.joint) for k in range(len(gains))]
        return max((k for k, place in enumerate(places) if place == (effect, joint)), key=lambda k: gains[k])

    friction, slope, elsewhere = best("coulomb_friction", 0), best("viscous_friction", 0), best("coulomb_friction", 1)
    better = max((friction, slope), key=lambda k: scores.support([elsewhere, k]))

    def beyond(_: Admission, chosen: Sequence[int], slack: float) -> list[int]:
        return [(friction, slope)[driven]] if {friction, slope} <= set(chosen) else []

    monkeypatch.setattr(Admission, "beyond_limits", beyond)
    assert Search(scores).pruned([elsewhere, friction, slope]) == [elsewhere, better]


def test_what_is_remembered_is_forgotten_at_other_weights(scores: Scores) -> None:
    before = scores.gains([]).copy()
    chosen = Search(scores).run()
    assert chosen
    scores.reweigh(chosen)
    weighted = scores.gains([])
    np.testing.assert_allclose(weighted, scores.model([]).gains(scores.groups))
    scores.weights = np.ones_like(scores.weights)
    scores.reweigh([])
    assert np.all(scores.weights < 0.9)
    assert not np.allclose(scores.gains([])[np.isfinite(before)], before[np.isfinite(before)])


def test_friction_of_both_joints_is_found_with_motions_left_out(scores: Scores) -> None:
    found, search = set(), Search(scores)
    for cause in judged(search.admission, search.run()):
        assert cause.held_out > 1.64
        hypothesis = scores.hypothesis(cause.candidate)
        found.add(hypothesis.place.joint)
    assert found == {0, 1}


def test_what_one_part_alone_shows_is_not_named_and_not_passed_over(
    scores: Scores, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(Scores, "held_out", lambda *_: 0.5)
    search = Search(scores)
    assert search.run() == []
    found = search.admission.one_sided([])
    assert found is not None
    assert "friction" in (name := scores.hypothesis(found).effect.name) or name == "transmission_coupling"
    monkeypatch.setattr(Scores, "recurring", lambda *_: 0.5)
    assert search.admission.one_sided([]) is None


def test_laws_that_explain_errors_alone_use_up_no_tries(scores: Scores, monkeypatch: pytest.MonkeyPatch) -> None:
    """However many stand before the first one that recurs."""
    supported = [candidate for candidate, _, nats in scores.ranked([]) if nats > 0.0]
    assert len(supported) > 4
    monkeypatch.setattr(Admission, "borne_out", lambda *_: True)
    monkeypatch.setattr(Scores, "recurring", lambda _, candidate, chosen: float(candidate == supported[-1]))
    assert len(list(Search(scores)._steps([]))) == 1


def test_of_two_causes_that_tell_the_same_one_stays(scores: Scores) -> None:
    """Presliding beside friction of either sign: each is a trifle beside the other, both together are not."""
    best = {
        name: max(
            (
                k
                for k in range(len(scores.owner))
                if (h := scores.hypothesis(k)).effect.name == name and h.place.joint == 0
            ),
            key=lambda k: scores.gains([])[k],
        )
        for name in ("presliding", "asymmetric_friction")
    }
    kept = Search(scores)._telling(list(best.values()))
    assert len(kept) == 1


def test_a_cause_in_whose_stead_nothing_is_as_good_is_not_told(scores: Scores, monkeypatch: pytest.MonkeyPatch) -> None:
    """However well it stands otherwise; alone or beside another."""
    sure, unsure = 0, 1

    def support(_: Scores, chosen: Sequence[int]) -> float:
        return 50.0 * (sure in chosen) + (AMBIGUOUS - 0.5) * (unsure in chosen)

    monkeypatch.setattr(Scores, "support", support)
    monkeypatch.setattr(Admission, "told", lambda *_: 2.0)
    search = Search(scores)
    assert search._telling([sure, unsure]) == [sure]
    assert search._telling([unsure]) == []


def best_of_each_joint(scores: Scores, name: str) -> list[int]:
    own = [k for k in range(len(scores.owner)) if scores.hypothesis(k).effect.name == name]
    return [
        max((k for k in own if scores.hypothesis(k).place.joint == joint), key=lambda k: scores.gains([])[k])
        for joint in range(2)
    ]


@pytest.mark.parametrize("wide", ["stribeck_friction", "asymmetric_friction"])
def test_a_law_without_what_it_is_named_for_gives_way_to_those_that_it_contains(
    evidence: Evidence, scores: Scores, wide: str
) -> None:
    """A Stribeck friction that does not rise, and one that is the same both ways, as a grid may hold its shape and not
    theirs."""
    best = best_of_each_joint(scores, wide)
    found, last = simpler(evidence, scores, best, fitted(evidence, scores, best))
    told = {((h := scores.hypothesis(k)).effect.name, h.place.joint) for k in found}
    assert told == {(name, joint) for name in ("coulomb_friction", "viscous_friction") for joint in range(2)}
    assert len(last.design.candidates) == len(found)


def test_what_a_law_contains_is_an_alternative_as_all_of_it_together_is(
    evidence: Evidence, record: Callable[[float], Evidence]
) -> None:
    """A friction that is the same both ways, and one that grows more than twice as much with speed one way."""
    for own, near in ((evidence, True), (record(0.6), False)):
        scores = Scores(own.design, own.blocks, own.folds)
        for cause in judged(Search(scores).admission, best_of_each_joint(scores, "asymmetric_friction")):
            place = scores.hypothesis(cause.candidate).place
            told = [(scores.hypothesis(a.candidate), a.gap) for a in cause.alternatives]
            gaps = {h.effect.name: gap for h, gap in told if h.place == place}
            for name in ("coulomb_friction", "viscous_friction"):
                assert (gaps[name] < AMBIGUOUS) is near
            assert [gap for _, gap in told] == sorted(gap for _, gap in told)


def test_what_stood_does_not_fall_by_a_sharper_shape(evidence: Evidence, monkeypatch: pytest.MonkeyPatch) -> None:
    """However little a search with sharper laws finds: what explains as much as before is still there."""
    usual = judging.searched

    def forgetful(own: Evidence, before: Searched | None = None) -> Searched:
        found = usual(own, before)
        return found if before is None else replace(found, chosen=found.chosen[:1])

    def same(own: Evidence, *_: object) -> Evidence:
        return own

    stood = judging.judge(evidence).chosen
    assert len(stood) > 1
    monkeypatch.setattr(judging, "sharpened", same)
    monkeypatch.setattr(judging, "searched", forgetful)
    assert judging.judge(evidence).chosen == stood


@pytest.mark.parametrize("wide", [False, True])
def test_wider_laws_are_as_sharp_as_what_they_are_held_against(
    evidence: Evidence, monkeypatch: pytest.MonkeyPatch, wide: bool
) -> None:
    """An asymmetric friction is compared with a Coulomb friction, and not its sign's width with the other's, whichever
    of them stands."""
    monkeypatch.setattr(sharpening, "WORTH", -np.inf)
    found = searched(evidence)
    if wide:
        found = replace(found, chosen=best_of_each_joint(found.scores, "asymmetric_friction"))
    refined = fitted(found.evidence, found.scores, found.chosen)
    sharp = sharpening.sharpened(evidence, found, found.chosen, refined)
    assert sharp is not None
    names = [evidence.design.hypotheses[c.hypothesis].effect.name for c in evidence.design.candidates]
    changed = {
        (names[k], evidence.design.hypotheses[new.hypothesis].place.joint)
        for k, (old, new) in enumerate(zip(evidence.design.candidates, sharp.design.candidates, strict=True))
        if not np.array_equal(old.theta, new.theta)
    }
    rubbing = {joint for name, joint in changed if name == "coulomb_friction"}
    assert rubbing
    assert {joint for name, joint in changed if name == "asymmetric_friction"} == rubbing


def test_a_shape_that_no_thing_of_its_name_has_is_no_alternative(
    scores: Scores, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Presliding over 0.4 rad cannot stand for a spring by that name."""
    forms = {
        float(candidate.theta[0]): k
        for k, candidate in enumerate(scores.design.candidates)
        if scores.hypothesis(k).effect.name == "presliding" and scores.hypothesis(k).place.joint == 0
    }

    def both(*_: object) -> list[Alternative]:
        return [Alternative(forms[0.4], 0.0), Alternative(forms[0.03], 1.0)]

    monkeypatch.setattr(causes, "rivals", both)
    (cause,) = judged(Search(scores).admission, [forms[0.03]])
    assert [a.candidate for a in cause.alternatives] == [forms[0.03]]


def test_a_law_beyond_its_limits_leaves_what_it_contains_in_its_place(
    scores: Scores, monkeypatch: pytest.MonkeyPatch
) -> None:
    """A Stribeck friction that falls towards rest instead of rising, by a trifle, is the joint's friction still."""
    wide, elsewhere = best_of_each_joint(scores, "stribeck_friction")

    def beyond(_: Admission, chosen: Sequence[int], slack: float) -> list[int]:
        return [wide] if wide in chosen else []

    monkeypatch.setattr(Admission, "beyond_limits", beyond)
    kept = Search(scores).pruned([wide, elsewhere])
    told = {((h := scores.hypothesis(k)).effect.name, h.place.joint) for k in kept}
    assert told == {("coulomb_friction", 0), ("viscous_friction", 0), ("stribeck_friction", 1)}
