"""The deciding motion: on pairs of causes where the answer is known, and against what simulated data then say."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.deciding.contest import Contest, contest
from estimator.diagnosis.deciding.experiment import PLAYINGS, UNDECIDED, Experiment, design_experiment
from estimator.diagnosis.deciding.experiment_motions import ExperimentMotion, family
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.rivals import AMBIGUOUS, rivals
from estimator.diagnosis.observed.drives_off import OffReading
from estimator.diagnosis.observed.turning import Turning, standing
from estimator.effects import Parameters, Place, Signals, effect
from estimator.excitation import MotionLimits

Array = NDArray[np.float64]
Law = tuple[str, Place, Parameters]

RATE = 250.0
NOISE = np.array([0.6, 0.5, 0.3])
HOME = np.zeros(3)


@pytest.fixture(scope="module")
def arm(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rrr")


@pytest.fixture(scope="module")
def limits(arm: RigidBody) -> MotionLimits:
    one = np.ones(3)
    return MotionLimits(-3.0 * one, 3.0 * one, 2.0 * one, 8.0 * one, 200.0 * one, arm.prior())


def measured(arm: RigidBody, law: Law, motion: tuple[Array, Array, Array, Array], seed: int) -> Trajectory:
    """A recording of an arm that has this effect."""
    name, place, parameters = law
    random = np.random.default_rng(seed)
    t, q, dq, ddq = motion
    tau = inverse_dynamics(arm, arm.prior(), q, dq, ddq)
    tau += effect(name).torque(place, parameters, Signals.of_motion(arm, t, q, dq, ddq))
    return Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau + NOISE * random.normal(size=q.shape))


def one_swing(amplitude: Sequence[float], hertz: float = 0.25) -> tuple[Array, Array, Array, Array]:
    """A motion that tells little: all joints to and fro at one frequency."""
    t = np.arange(round(12.0 * RATE)) / RATE
    w, a = 2.0 * np.pi * hertz, np.array(amplitude)
    s, c = np.sin(w * t)[:, None], np.cos(w * t)[:, None]
    return t, 0.3 + a * s, a * w * c, -a * w**2 * s


def gathered(arm: RigidBody, trajectories: Sequence[Trajectory]) -> tuple[Evidence, Scores]:
    evidence = gather(arm, trajectories, 0.02)
    return evidence, Scores(evidence.design, evidence.blocks, evidence.folds)


def between(scores: Scores, evidence: Evidence, rivals: Sequence[tuple[str, Place]]) -> Contest:
    known = [(h.effect.name, h.place) for h in scores.design.hypotheses]
    return contest(scores, evidence, [], [known.index(rival) for rival in rivals])


def kinds_by_gap(contested: Contest, limits: MotionLimits, pair: tuple[int, int] = (0, 1)) -> dict[str, float]:
    """The best expected gap of each kind of motion on joint 2 alone, and of the motions of all joints."""
    best: dict[str, float] = {}
    for motion in family(contested.design.body, limits, HOME, [1], contested.band):
        gaps = contested.expected_gaps(contested.planned(*motion.sampled(contested.rate), 2))
        gap = min(gaps[pair], gaps[pair[::-1]])
        best[motion.kind] = max(best.get(motion.kind, -np.inf), gap)
    return best


JOINT = Place(1)
PAIRS = {
    "viscous against Coulomb": (
        ("viscous_friction", JOINT, {"coefficient": 0.8}),
        ("coulomb_friction", JOINT),
        ([0.5, 0.06, 0.5], 0.25),
        "constant speeds",
        "micro-reversals",
    ),
    "presliding against Coulomb": (
        ("presliding", JOINT, {"stiffness": 100.0, "level": 0.15}),
        ("coulomb_friction", JOINT),
        ([0.5, 0.3, 0.5], 0.25),
        "micro-reversals",
        "slow sweep",
    ),
    "spring against tilt": (
        ("joint_spring", JOINT, {"stiffness": 0.5, "centre": 0.0}),
        ("base_tilt", Place()),
        ([0.1, 0.1, 0.1], 0.25),
        "rests in a grid of poses",
        "micro-reversals",
    ),
}


@pytest.mark.parametrize("name", PAIRS)
def test_motion_that_tells_two_causes_apart_is_preferred_and_keeps_its_promise(
    name: str, arm: RigidBody, limits: MotionLimits
) -> None:
    law, rival, (amplitude, hertz), telling, idle = PAIRS[name]
    so_far = [measured(arm, law, one_swing(amplitude, hertz), seed) for seed in range(2)]
    evidence, scores = gathered(arm, so_far)
    contested = between(scores, evidence, [law[:2], rival])
    before = contested.support(contested.known)
    assert before[0] - before[1] < 10.0, "these recordings decide already"
    gaps = kinds_by_gap(contested, limits)
    assert gaps[telling] > max(gaps[idle], UNDECIDED), gaps
    chosen = design_experiment(contested, limits, HOME)
    assert chosen is not None
    assert chosen.predicted_gap >= 0.9 * max(gaps.values())
    _, q, dq, ddq = chosen.motion.sampled(RATE)
    assert limits.worst(arm, q, dq, ddq) <= 1.0
    np.testing.assert_allclose(dq[[0, -1]], 0.0, atol=1e-3)
    after = [measured(arm, law, chosen.motion.sampled(RATE), seed) for seed in range(7, 7 + chosen.playings)]
    more, again = gathered(arm, [*so_far, *after])
    decided = between(again, more, [law[:2], rival])
    support = decided.support(decided.known)
    assert 0.5 < (support[0] - support[1]) / chosen.gaps[0, 1] < 2.0


def test_a_form_that_is_not_seen_is_sought_as_large_as_it_usually_is(arm: RigidBody, limits: MotionLimits) -> None:
    """Coulomb's friction beside an asymmetric one: fitted, the wider law is hardly other, and no motion would decide;
    as joints rub that do so one way more than the other, a motion at speed does."""
    law: Law = ("coulomb_friction", JOINT, {"level": 0.18})
    so_far = [measured(arm, law, one_swing([0.5, 0.06, 0.5]), seed) for seed in range(2)]
    evidence, scores = gathered(arm, so_far)
    assert behind(scores, "asymmetric_friction") < AMBIGUOUS
    contested = between(scores, evidence, [law[:2], ("asymmetric_friction", JOINT)])
    chosen = design_experiment(contested, limits, HOME)
    assert chosen is not None
    assert chosen.predicted_gap > UNDECIDED
    assert chosen.gaps[0, 1] == pytest.approx(chosen.gaps[1, 0])
    after = [measured(arm, law, chosen.motion.sampled(RATE), seed) for seed in range(7, 7 + chosen.playings)]
    _, again = gathered(arm, [*so_far, *after])
    # A gap scatters by the square root of twice its size.
    scatter = np.sqrt(2.0 * chosen.predicted_gap)
    assert behind(again, "asymmetric_friction") == pytest.approx(chosen.predicted_gap, abs=2.0 * scatter)


def test_a_rise_from_rest_is_sought_beside_bristles_as_beside_the_friction_that_they_make(
    arm: RigidBody, limits: MotionLimits
) -> None:
    """In their stead a Stribeck friction is refuted long since, and what is open is whether it stands beside them."""
    law: Law = ("presliding", JOINT, {"stiffness": 20.0, "level": 0.3})
    so_far = [measured(arm, law, one_swing([0.5, 0.1, 0.5]), seed) for seed in range(2)]
    evidence, scores = gathered(arm, so_far)
    contested = between(scores, evidence, [law[:2], ("stribeck_friction", JOINT)])
    before = contested.support(contested.known)
    assert before[0] - before[1] > 10.0
    assert behind(scores, "stribeck_friction", law[0]) < AMBIGUOUS
    chosen = design_experiment(contested, limits, HOME)
    assert chosen is not None
    assert chosen.gaps[0, 1] == pytest.approx(chosen.gaps[1, 0])
    after = [measured(arm, law, chosen.motion.sampled(RATE), seed) for seed in range(7, 7 + chosen.playings)]
    _, again = gathered(arm, [*so_far, *after])
    scatter = np.sqrt(2.0 * chosen.predicted_gap)
    assert behind(again, "stribeck_friction", law[0]) == pytest.approx(chosen.predicted_gap, abs=2.0 * scatter)


@pytest.mark.parametrize("crawl", [0.0, 1e-3])
def test_a_joint_that_rubs_tells_an_offset_in_rest_no_better_than_its_friction_holds_it(
    crawl: float, arm: RigidBody, limits: MotionLimits
) -> None:
    """Beside a friction of 0.6 N·m each rest says as much of the joint as one reading with that error, however often it
    is played again, and where the joint crawls by a milliradian a second as well."""
    level, rests = 0.6, 3
    law: Law = ("coulomb_friction", JOINT, {"level": level})
    evidence, scores = gathered(arm, [measured(arm, law, one_swing([0.5, 0.5, 0.5]), seed) for seed in range(2)])
    known = [(h.effect.name, h.place) for h in scores.design.hypotheses]
    names = [("torque_offset", JOINT), ("joint_spring", JOINT)]
    rubbing = [max(np.flatnonzero(scores.owner == known.index(law[:2])), key=scores.gains([]).item)]
    information = {}
    for others in ([], rubbing):
        contested = contest(scores, evidence, others, [known.index(name) for name in names])
        t = np.arange(round(rests * 4.0 * contested.rate)) / contested.rate
        # A second of motion, three of rest, and so on.
        w = np.pi * np.minimum(t % 4.0, 1.0)
        step = np.floor(t / 4.0)
        q = np.zeros((len(t), 3))
        q[:, 1] = 0.2 * (step + 0.5 - 0.5 * np.cos(w)) + crawl * t
        offset = contested.design.candidates[contested.rivals[0].candidates[0]].columns[0]
        place = contested.design.position[1, offset]
        for playings in (1, 8):
            planned = contested.planned(t, q, np.gradient(q, t, axis=0), np.zeros_like(q), playings)
            information[len(others), playings] = planned.grams[1][place, place]
    moving = information[0, 1] / 4.0
    assert information[1, 1] < moving + 1.5 * rests / level**2
    assert information[1, 1] > 0.7 * moving
    assert information[0, 8] == pytest.approx(8.0 * information[0, 1])
    assert information[1, 8] < 8.0 * information[1, 1] - 5.0 * rests / level**2


def test_what_held_a_joint_so_far_does_not_hold_it_in_a_motion_of_it(arm: RigidBody) -> None:
    """A joint that never moved, whose friction nobody knows, is told of by a motion."""
    law: Law = ("torque_offset", JOINT, {"offset": 1.0})
    evidence, scores = gathered(arm, [measured(arm, law, one_swing([0.5, 0.5, 0.5]), seed) for seed in range(2)])
    known = [(h.effect.name, h.place) for h in scores.design.hypotheses]
    contested = contest(scores, evidence, [], [known.index(("torque_offset", JOINT))])
    t = np.arange(round(8.0 * contested.rate)) / contested.rate
    # Of eight seconds the joint stands for two.
    q = 0.5 * np.sin(np.pi * np.maximum(t - 2.0, 0.0) / 3.0)[:, None] * np.array([0.0, 1.0, 0.0])
    told = []
    for turning in ({}, {1: Turning(1, 0.0, 1.0, held=50.0)}):
        own = replace(contested, noise=replace(contested.noise, turning=turning))
        told.append(own.planned(t, q, np.gradient(q, t, axis=0), np.zeros_like(q)).grams[1])
    np.testing.assert_allclose(told[1], told[0], rtol=1e-9, atol=1e-9)


def test_a_joint_that_stands_throughout_does_so_but_for_rounding() -> None:
    random = np.random.default_rng(0)
    still = 1.2 + 2e-16 * random.integers(-1, 2, 200)
    assert set(standing(still, np.gradient(still), 2)) == {200.0}
    trembling = 1.2 + 1e-4 * random.normal(size=200)
    assert set(standing(trembling, np.gradient(trembling), 2)) == {200.0}
    going = np.concatenate([np.full(50, 0.3), 0.3 + 0.01 * np.arange(150)])
    speed = np.repeat([0.0, 0.01], [50, 150])
    np.testing.assert_array_equal(standing(going, speed, 2), np.repeat([50.0, 0.0], [50, 150]))
    assert not standing(going, speed, 51).any()


def test_drives_that_are_off_tell_an_asymmetric_friction_from_a_symmetric_one_with_an_offset(
    arm: RigidBody, limits: MotionLimits
) -> None:
    """They make the same torque in every motion: said beforehand, and once the drives have been read, that nothing
    more is to be had there."""
    laws: list[Law] = [
        ("coulomb_friction", JOINT, {"level": 0.5}),
        ("torque_offset", JOINT, {"offset": 0.2}),
    ]
    recordings = [measured(arm, laws[0], one_swing([0.5, 0.8, 0.5]), seed) for seed in range(2)]
    recordings = [replace(r, tau=r.tau + np.array([0.0, 0.2, 0.0])) for r in recordings]
    evidence, scores = gathered(arm, recordings)
    known = [(h.effect.name, h.place) for h in scores.design.hypotheses]
    contests = []
    for finding, other in (laws, laws[::-1]):
        beside = max(np.flatnonzero(scores.owner == known.index(other[:2])), key=scores.gains([]).item)
        rivals = [known.index(finding[:2]), known.index(("asymmetric_friction", JOINT))]
        contests.append(contest(scores, evidence, [beside], rivals))
        of_finding, of_rival = (rival.freedom for rival in contests[-1].rivals)
        assert set(of_rival) == {min(of_finding)}, "in the place of both it costs no more than they do"
    of_friction, of_offset = (design_experiment(one, limits, HOME) for one in contests)
    assert of_friction is None, "beside either it makes the torque of both"
    assert of_offset is not None and of_offset.motion is None
    assert of_offset.told == ((0, 1),)
    known_offset = OffReading(np.array([0.0, 0.2, 0.0]), np.full(3, 0.01), 30.0)
    read = replace(contests[1], design=replace(contests[1].design, reading=known_offset))
    assert design_experiment(read, limits, HOME) is None


def test_a_promise_is_of_the_pairs_that_the_experiment_tells() -> None:
    # Rivals 0 and 1 it tells apart; of 1 and 2 the data so far speak for the wrong one, and another motion tells.
    gaps = np.array([[0.0, 20.0, 30.0], [12.0, 0.0, -6.0], [40.0, 2.0, 0.0]])
    reading = Experiment(None, 2, gaps, told=((0, 1), (0, 2), (1, 2)), alike=())
    assert reading.tells == ((0, 1), (0, 2))
    assert (reading.predicted_gap, reading.worst, reading.decided) == (12.0, -6.0, 2)


def test_no_motion_is_given_for_a_viscous_friction_that_stands_beside_an_offset(
    arm: RigidBody, limits: MotionLimits
) -> None:
    """A friction that is larger one way makes all three, and may be viscous alike both ways: as larger one way as
    joints usually are, at speed, it would be told from the viscous one alone."""
    laws: list[Law] = [
        ("viscous_friction", JOINT, {"coefficient": 0.8}),
        ("coulomb_friction", JOINT, {"level": 0.5}),
        ("torque_offset", JOINT, {"offset": 0.2}),
    ]
    motion = one_swing([0.5, 0.8, 0.5])
    signals = Signals.of_motion(arm, *motion)
    more = sum(effect(name).torque(place, parameters, signals) for name, place, parameters in laws[1:])
    so_far = [measured(arm, laws[0], motion, seed) for seed in range(2)]
    evidence, scores = gathered(arm, [replace(r, tau=r.tau + more) for r in so_far])
    known = [(h.effect.name, h.place) for h in scores.design.hypotheses]
    first, rival = known.index(laws[0][:2]), known.index(("asymmetric_friction", JOINT))
    beside = [max(np.flatnonzero(scores.owner == known.index(law[:2])), key=scores.gains([]).item) for law in laws[1:]]
    alone = design_experiment(contest(scores, evidence, beside[:1], [first, rival]), limits, HOME)
    assert alone is not None and alone.decided == 1
    chosen = design_experiment(contest(scores, evidence, beside, [first, rival]), limits, HOME)
    assert chosen is None or chosen.decided == 0


def test_the_weaker_a_cause_the_more_often_the_motion_is_played(arm: RigidBody, limits: MotionLimits) -> None:
    playings = []
    for level in (0.5, 0.12):
        law: Law = ("coulomb_friction", JOINT, {"level": level})
        so_far = [measured(arm, law, one_swing([0.5, 0.06, 0.5]), seed) for seed in range(2)]
        evidence, scores = gathered(arm, so_far)
        chosen = design_experiment(between(scores, evidence, [law[:2], ("asymmetric_friction", JOINT)]), limits, HOME)
        assert chosen is not None
        assert chosen.decided == 1 or chosen.playings == max(PLAYINGS)
        playings.append(chosen.playings)
    assert playings[0] == min(PLAYINGS) < playings[1]


def test_a_wider_law_of_another_joint_is_judged_as_it_was_fitted(arm: RigidBody, limits: MotionLimits) -> None:
    law: Law = ("coulomb_friction", JOINT, {"level": 0.18})
    evidence, scores = gathered(arm, [measured(arm, law, one_swing([0.5, 0.06, 0.5]), seed) for seed in range(2)])
    motion = one_swing([0.5, 0.5, 0.5])
    here, there = (
        (contested := between(scores, evidence, [law[:2], ("asymmetric_friction", place)])).expected_gaps(
            contested.planned(*motion, 2)
        )
        for place in (JOINT, Place(0))
    )
    assert here[0, 1] == here[1, 0]
    assert there[0, 1] != there[1, 0]


def behind(scores: Scores, name: str, finding: str = "coulomb_friction") -> float:
    """nats by which a law of the joint is behind the one that was found."""
    own = [k for k, h in enumerate(map(scores.hypothesis, range(len(scores.owner)))) if h.place == JOINT]
    found = max((k for k in own if scores.hypothesis(k).effect.name == finding), key=scores.gains([]).item)
    beside = rivals(Admission(scores), found, [found])
    return next(r.gap for r in beside if r.candidate in own and scores.hypothesis(r.candidate).effect.name == name)


def test_no_motion_is_given_where_the_limits_leave_none_that_decides(arm: RigidBody) -> None:
    law: Law = ("joint_spring", JOINT, {"stiffness": 0.5, "centre": 0.0})
    evidence, scores = gathered(arm, [measured(arm, law, one_swing([0.1, 0.1, 0.1]), seed) for seed in range(2)])
    contested = between(scores, evidence, [law[:2], ("base_tilt", Place())])
    narrow = MotionLimits(np.full(3, 0.29), np.full(3, 0.31), np.full(3, 0.05), np.full(3, 0.2))
    assert design_experiment(contested, narrow, np.full(3, 0.3)) is None


def test_same_seed_gives_the_same_family(arm: RigidBody, limits: MotionLimits) -> None:
    def all_of(seed: int) -> list[ExperimentMotion]:
        return list(family(arm, limits, HOME, [0, 2], band=10.0, seed=seed))

    first, second, other = all_of(1), all_of(1), all_of(2)
    assert len(first) >= 20
    assert {motion.joints for motion in first} == {(0,), (2,), (0, 1, 2)}
    assert all(np.array_equal(a.points, b.points) for a, b in zip(first, second, strict=True))
    assert any(not np.array_equal(a.points, b.points) for a, b in zip(first, other, strict=True))


def test_motions_of_an_arm_with_little_torque_are_made_smaller(arm: RigidBody, limits: MotionLimits) -> None:
    weak = MotionLimits(
        limits.lower, limits.upper, limits.velocity, limits.acceleration, np.array([30.0, 25.0, 12.0]), arm.prior()
    )
    motions = list(family(arm, weak, HOME, [1], band=10.0))
    assert motions
    for motion in motions:
        assert weak.worst(arm, *motion.sampled(50.0)[1:]) < 1.02, motion.kind
