"""Friction that turns over within a part of a milliradian, or a few: one name each, at the shape that it has."""

from __future__ import annotations

from collections import defaultdict
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming import unexplained
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.causes import judged
from estimator.diagnosis.naming.lack_of_fit import Misfit
from estimator.diagnosis.naming.plainer import told_once, without_menders
from estimator.diagnosis.naming.rivals import AMBIGUOUS, Alternative, rivals, told_as
from estimator.diagnosis.naming.search import Search

Array = NDArray[np.float64]
Friction = Callable[[Array, Array], Array]
NOISE = 0.2
"""N·m, white."""


def bristles(q: Array, give: float) -> Array:
    """(samples, joints) Dahl's friction of level one, step by step along the angle."""
    bent = np.zeros_like(q)
    for k in range(1, len(q)):
        moved = q[k] - q[k - 1]
        bent[k] = np.sign(moved) + (bent[k - 1] - np.sign(moved)) * np.exp(-np.abs(moved) / give)
    return bent


@pytest.fixture(scope="module")
def record(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> Callable[..., tuple[RigidBody, list[Trajectory]]]:
    """Two joints with some friction, each of three motions played twice."""

    def make(friction: Friction, size: float = 1.0) -> tuple[RigidBody, list[Trajectory]]:
        body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
            q, dq, ddq = size * q, size * dq, size * ddq
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + friction(q, dq)
            for _ in range(2):
                measured = q + 1e-7 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + NOISE * random.normal(size=q.shape)))
        return body, recordings

    return make


@pytest.fixture(scope="module")
def gathered(record: Callable[[Friction], tuple[RigidBody, list[Trajectory]]]) -> Callable[[Friction], Evidence]:
    return lambda friction: gather(*record(friction), 0.05)


def scores_of(evidence: Evidence) -> Scores:
    return Scores(
        evidence.design, evidence.blocks, evidence.folds, evidence.noise.news, (), evidence.noise.degrees_of_freedom
    )


def best_of(scores: Scores, names: tuple[str, ...], joint: int = 0) -> list[int]:
    """Of each effect the candidate of the joint that adds most to those before it."""
    chosen: list[int] = []
    for name in names:
        own = [
            k
            for k in range(len(scores.owner))
            if (h := scores.hypothesis(k)).effect.name == name and h.place.joint == joint and h.place.other is None
        ]
        chosen.append(max(own, key=lambda k: scores.gains(chosen)[k]))
    return chosen


@pytest.mark.parametrize(("sharp", "names"), [(0.0, {"presliding"}), (1.5, {"presliding", "coulomb_friction"})])
def test_what_mended_the_shape_that_a_grid_has_falls_at_the_best_shape(
    gathered: Callable[[Friction], Evidence], sharp: float, names: set[str]
) -> None:
    """At both joints."""
    evidence = gathered(lambda q, dq: 3.0 * bristles(q, 0.016) + sharp * np.sign(dq))
    scores = scores_of(evidence)
    both = [k for joint in range(2) for k in best_of(scores, ("presliding", "coulomb_friction"), joint)]
    left, shaped = told_once(evidence, scores, both, fitted(evidence, scores, both))
    told = [scores.hypothesis(k) for k in left]
    assert {(h.effect.name, h.place.joint) for h in told} == {(name, joint) for name in names for joint in range(2)}
    assert [candidate.hypothesis for candidate in shaped.design.candidates] == [
        scores.design.candidates[k].hypothesis for k in left
    ]


def test_presliding_between_two_shapes_of_the_grid_is_named_once(
    record: Callable[[Friction], tuple[RigidBody, list[Trajectory]]],
) -> None:
    found = diagnose(*record(lambda q, dq: np.array([1.0, 0.0]) * bristles(q, 1.4e-3)))
    assert [(f.effect, f.place.joint) for f in found.findings] == [("presliding", 0)]


def test_friction_that_turns_over_within_a_part_of_a_milliradian_is_coulomb_friction_alone(
    record: Callable[[Friction], tuple[RigidBody, list[Trajectory]]],
) -> None:
    found = diagnose(*record(lambda q, dq: np.array([1.0, 0.0]) * 3.0 * bristles(q, 3e-4)))
    (dry,) = found.findings
    assert (dry.effect, dry.place.joint) == ("coulomb_friction", 0), dry.alternatives
    assert abs(float(dry.parameters["level"].value) - 3.0) < 0.06


@pytest.mark.parametrize(("size", "name"), [(2e-3, "presliding"), (0.05, "coulomb_friction")])
def test_bristles_that_a_small_motion_shows_are_presliding(
    record: Callable[..., tuple[RigidBody, list[Trajectory]]], size: float, name: str
) -> None:
    """The same bristles, in a motion of milliradians and in one of tenths."""
    (dry,) = diagnose(*record(lambda q, dq: np.array([3.0, 0.0]) * bristles(q, 3e-4), size=size)).findings
    assert (dry.effect, dry.place.joint) == (name, 0)
    if name == "presliding":
        assert abs(float(dry.parameters["stiffness"].value) - 3.0 / 3e-4) < 1500.0


def test_what_the_dry_part_of_a_wider_law_explains_speaks_for_no_asymmetry(
    gathered: Callable[[Friction], Evidence],
) -> None:
    """Presliding beside viscous friction, of which a part turns over at once."""
    first = np.array([1.0, 0.0])
    evidence = gathered(lambda q, dq: first * (2.0 * bristles(q, 0.03) + 0.6 * np.sign(dq) + 0.8 * dq))
    scores = scores_of(evidence)
    presliding, viscous = best_of(scores, ("presliding", "viscous_friction"))
    gaps = {
        scores.hypothesis(rival.candidate).effect.name: rival.gap
        for rival in rivals(Admission(scores), viscous, [presliding, viscous])
        if scores.hypothesis(rival.candidate).place.joint == 0
    }
    assert gaps["asymmetric_friction"] > AMBIGUOUS


@pytest.mark.parametrize(
    ("give", "sharp", "names"),
    [
        (2e-4, 0.0, ["coulomb_friction"]),
        (2e-4, 2.0, ["coulomb_friction"]),
        (8e-3, 0.0, ["presliding"]),
        (8e-3, 2.0, ["coulomb_friction", "presliding"]),
    ],
)
def test_what_only_mends_the_form_of_coulomb_friction_is_told_as_that(
    gathered: Callable[[Friction], Evidence], give: float, sharp: float, names: list[str]
) -> None:
    """With the alternatives of what stands for it, and whatever else it is put beside."""
    evidence = gathered(lambda q, dq: np.array([1.0, 0.0]) * (3.0 * bristles(q, give) + sharp * np.sign(dq)))
    scores = scores_of(evidence)
    stood = best_of(scores, ("presliding", "coulomb_friction") if sharp else ("presliding",))
    told, named = without_menders(evidence, scores, stood, fitted(evidence, scores, stood))
    assert sorted(scores.hypothesis(cause.candidate).effect.name for cause in told) == names
    assert len(named.design.candidates) == len(told)
    if names == ["coulomb_friction"]:
        (level,) = named.coefficients(0)
        assert abs(level - 3.0 - sharp) < 0.1
        own = scores.owner[told[0].candidate]
        assert all(scores.owner[rival.candidate] != own for rival in told[0].alternatives)
        assert len(told[0].alternatives) >= len(judged(Search(scores).admission, stood)[0].alternatives) - 1


@pytest.mark.parametrize(
    ("one_way", "names"),
    [
        (0.0, ["coulomb_friction", "viscous_friction"]),
        (0.3, ["asymmetric_friction"]),
        (0.4, ["asymmetric_friction"]),
    ],
)
def test_a_wider_law_beside_what_mends_its_form_is_told_as_those_that_it_contains(
    gathered: Callable[[Friction], Evidence], one_way: float, names: list[str]
) -> None:
    """An asymmetric friction that is none, in Coulomb's place beside presliding; and one that is, also where it
    explains less than a hundredth of the friction, and leaves nothing."""

    def friction(q: Array, dq: Array) -> Array:
        return np.array([1.0, 0.0]) * (3.0 * bristles(q, 1e-4) + 0.4 * dq + one_way * np.maximum(dq, 0.0))

    evidence = gathered(friction)
    scores = scores_of(evidence)
    stood = best_of(scores, ("presliding", "asymmetric_friction"))
    told, named = without_menders(evidence, scores, stood, fitted(evidence, scores, stood))
    assert sorted(scores.hypothesis(cause.candidate).effect.name for cause in told) == names
    shaped = [named.design.hypotheses[own.hypothesis] for own in named.design.candidates]
    assert shaped == [scores.hypothesis(cause.candidate) for cause in told]


def test_what_is_left_within_the_noise_s_own_error_makes_nothing_a_trifle(
    gathered: Callable[[Friction], Evidence],
) -> None:
    evidence = gathered(lambda q, dq: 0.8 * np.sign(dq) + 0.05 * dq)
    known = Scores(evidence.design, evidence.blocks, evidence.folds)
    (dry,) = best_of(known, ("coulomb_friction",))
    left = float(known.excess([dry])[0]) - 1.0
    assert left > 0.0
    unsure = Scores(evidence.design, evidence.blocks, evidence.folds, freedom=1.0 / left**2)
    assert unsure.noise_error > left > known.noise_error
    nothing = np.zeros(len(evidence.design.channels))
    told = [Admission(scores).told(dry, [dry], nothing) for scores in (known, unsure)]
    assert told[1] > 2.0 * told[0]


@pytest.mark.parametrize(("rise", "near"), [(0.0, False), (1.0, True)])
def test_what_is_told_as_coulomb_friction_has_the_wider_laws_beside_it_that_were_not_refuted(
    record: Callable[[Friction, float], tuple[RigidBody, list[Trajectory]]], rise: float, near: bool
) -> None:
    """Bristles that a joint sticks by, with and without a friction that is larger from rest."""
    slow = record(lambda q, dq: 3.0 * bristles(q, 1e-4) * (1.0 + rise * np.exp(-((dq / 0.1) ** 2))), 0.1)
    evidence = gather(*slow, 0.05)
    scores = scores_of(evidence)
    bent, plain, wide, other = (
        best_of(scores, (name,))[0]
        for name in ("presliding", "coulomb_friction", "stribeck_friction", "friction_drift")
    )
    had = [Alternative(plain, 5.0), Alternative(wide, 20.0), Alternative(other, 10.0)]
    told = told_as(Admission(scores), bent, [bent], plain, had)
    assert {one.candidate for one in told} == {wide, other}
    assert (told[0].candidate == wide and told[0].gap < AMBIGUOUS) is near
    assert all(one.gap >= AMBIGUOUS for one in told) is not near


@pytest.mark.parametrize(("slope", "flagged"), [(0.05, False), (1.0, True)])
def test_what_one_part_of_the_motions_shows_is_told_from_a_hundredth_on(
    gathered: Callable[[Friction], Evidence], monkeypatch: pytest.MonkeyPatch, slope: float, flagged: bool
) -> None:
    evidence = gathered(lambda q, dq: np.array([1.0, 0.0]) * (2.0 * np.sign(dq) + slope * dq))
    scores = scores_of(evidence)
    dry, viscous = best_of(scores, ("coulomb_friction", "viscous_friction"))
    monkeypatch.setattr(Admission, "one_sided", lambda *_: viscous)
    monkeypatch.setattr(unexplained, "misfits", no_misfits)
    left = unexplained.unexplained_by(evidence, scores, fitted(evidence, scores, [dry, viscous]), [dry], ())
    assert (0 in left) is flagged


@pytest.mark.parametrize("leaves_it_too", [False, True])
def test_what_a_cause_as_good_does_not_leave_is_not_unexplained(
    gathered: Callable[[Friction], Evidence], monkeypatch: pytest.MonkeyPatch, leaves_it_too: bool
) -> None:
    """It is in the set of names; what each of them leaves has none."""
    evidence = gathered(lambda q, dq: np.array([1.0, 0.0]) * (0.2 * np.sign(dq) + 0.1 * dq))
    scores = scores_of(evidence)
    dry, viscous = best_of(scores, ("coulomb_friction", "viscous_friction"))
    pattern = int(np.flatnonzero(scores.is_map[scores.owner])[0])

    def left_by(_: Scores, chosen: list[int]) -> dict[int, Misfit]:
        seen = leaves_it_too or viscous not in chosen
        return defaultdict(lambda: Misfit(0, 0.0, 1.0), {0: Misfit(pattern, 0.3, 0.0 if seen else 1.0)})

    monkeypatch.setattr(Admission, "one_sided", lambda *_: None)
    monkeypatch.setattr(unexplained, "misfits", left_by)
    refined = fitted(evidence, scores, [dry, viscous])
    assert 0 in unexplained.unexplained_by(evidence, scores, refined, [dry], ())
    left = unexplained.unexplained_by(evidence, scores, refined, [dry], (), [(viscous,)])
    assert (0 in left) is leaves_it_too


def no_misfits(*_: object) -> dict[int, Misfit]:
    """No map explains anything."""
    return defaultdict(lambda: Misfit(0, 0.0, 1.0))


@pytest.mark.parametrize(("level", "flagged"), [(4.0, False), (0.3, True)])
def test_a_law_is_exact_to_a_tenth_of_its_torque(
    record: Callable[[Friction], tuple[RigidBody, list[Trajectory]]], level: float, flagged: bool
) -> None:
    """What the square of the speed adds is told beside a friction that is no hundred times as strong."""
    body, recordings = record(lambda q, dq: level * np.sign(dq) + np.array([0.035, 0.0]) * (dq * np.abs(dq) - 1.5 * dq))
    found = diagnose(body, recordings)
    assert bool(found.unexplained) is flagged, found.unexplained
