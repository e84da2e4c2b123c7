"""What the motion does is told from what explains the noise: torques beside angles with other errors than theirs."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import butter, sosfiltfilt

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.exchange import exchange
from estimator.diagnosis.evidence.gathered import Evidence, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.accuracy import other_errors
from estimator.diagnosis.naming.search import Search

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]

RATE = 200.0
STIFFNESS = 800.0
"""N·m/rad by which the servo answers to an error of its encoders."""


@pytest.fixture(scope="module")
def body(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rr")


def served(
    body: RigidBody,
    make_periodic: Periodic,
    lacking: Callable[[Array], Array],
    error_rad: float = 2e-3,
    times: int = 2,
    alike: bool = False,
) -> list[Trajectory]:
    """Motions of as many periods, each played so many times, by a servo that answers to its encoders' errors, which
    may be ``alike`` in all playings of a motion; the arm has torques that the model is ``lacking`` (dq)."""
    random, low = np.random.default_rng(4), butter(2, 10.0, fs=RATE, output="sos")
    recordings = []
    for motion in range(6 // times):
        q, dq, ddq = (np.tile(x, (times, 1)) for x in make_periodic(2, 3.0, RATE, motion)[1:])
        for _ in range(times):
            white = random.normal(size=q.shape)
            if alike:
                white = np.tile(np.random.default_rng(motion).normal(size=(len(q) // times, q.shape[1])), (times, 1))
            error = sosfiltfilt(low, white, axis=0)
            error *= error_rad / error.std()
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + lacking(dq) - STIFFNESS * error
            tau += 0.02 * random.normal(size=q.shape)
            recordings.append(Trajectory(np.arange(len(q)) / RATE, q + error, tau))
    return recordings


def nothing(dq: Array) -> Array:
    return np.zeros_like(dq)


def friction(dq: Array) -> Array:
    return np.asarray(0.6 * np.tanh(dq / 0.01) * np.array([0.0, 1.0]))


def scores_of(evidence: Evidence, ways: slice = slice(None)) -> Scores:
    exchanges = other_errors(evidence)[ways]
    return Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news, exchanges)


def best_of(scores: Scores, name: str, joint: int | None) -> int:
    gains = scores.gains([])
    own = [
        k
        for k in range(len(scores.owner))
        if (h := scores.hypothesis(k)).effect.name == name and h.place.joint == joint
    ]
    return max(own, key=lambda k: gains[k])


def test_what_a_servo_answers_to_its_encoders_is_no_cause(body: RigidBody, make_periodic: Periodic) -> None:
    recordings = served(body, make_periodic, nothing)
    evidence = gather(body, recordings, 0.05)
    scores, without = scores_of(evidence), Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)
    gains = scores.gains([])
    deceptive = int(np.argmax(np.where(scores.is_map[scores.owner], -np.inf, gains)))
    assert gains[deceptive] > 20.0, "the noise is explained by a law of the angles"
    assert Search(without).run(), "and is borne out by rows left out"
    assert scores.recurring(deceptive, []) < 0.5
    assert without.recurring(deceptive, []) == 1.0
    assert diagnose(body, recordings).verdict == "clean"


def test_what_is_there_in_every_playing_recurs(body: RigidBody, make_periodic: Periodic) -> None:
    recordings = served(body, make_periodic, friction)
    scores = scores_of(gather(body, recordings, 0.05))
    assert scores.recurring(best_of(scores, "coulomb_friction", 1), []) == pytest.approx(1.0, abs=0.1)
    found = diagnose(body, recordings)
    assert [(finding.effect, finding.place.joint) for finding in found.findings] == [("coulomb_friction", 1)]


def test_nor_where_the_errors_are_alike_in_every_playing(body: RigidBody, make_periodic: Periodic) -> None:
    """As of a servo that repeats a motion to less than a count."""
    recordings = served(body, make_periodic, nothing, alike=True)
    evidence = gather(body, recordings, 0.05)
    again, slow = (scores_of(evidence, slice(k, k + 1)) for k in (0, 1))
    gains = again.gains([])
    deceptive = int(np.argmax(np.where(again.is_map[again.owner], -np.inf, gains)))
    assert gains[deceptive] > 20.0, "the noise is explained by a law of the angles"
    assert again.recurring(deceptive, []) > 0.75, "and is there in every playing"
    assert slow.recurring(deceptive, []) < 0.5
    assert scores_of(evidence).recurring(deceptive, []) == slow.recurring(deceptive, [])
    assert Search(again).run(), "so that it would be named"
    assert not diagnose(body, recordings).findings


def test_played_once_it_is_no_cause_either(body: RigidBody, make_periodic: Periodic) -> None:
    recordings = served(body, make_periodic, nothing, error_rad=6e-3, times=1)
    evidence = gather(body, recordings, 0.05)
    assert not evidence.repeats
    without = Scores(evidence.design, evidence.blocks, evidence.folds)
    deceived = Search(without).run()
    assert deceived, "the noise is explained by a law of the angles, in rows left out too"
    scores = scores_of(evidence)
    assert max(scores.recurring(candidate, []) for candidate in deceived) < 0.75
    assert diagnose(body, recordings).verdict == "clean"


def test_played_once_a_cause_is_there_with_the_slow_motion(body: RigidBody, make_periodic: Periodic) -> None:
    recordings = served(body, make_periodic, friction, times=1)
    found = diagnose(body, recordings)
    assert [(finding.effect, finding.place.joint) for finding in found.findings] == [("coulomb_friction", 1)]


def test_a_map_of_places_that_no_motion_comes_to_is_judged(body: RigidBody, make_periodic: Periodic) -> None:
    scores = scores_of(gather(body, served(body, make_periodic, friction), 0.05))
    for k in np.flatnonzero(scores.is_map[scores.owner]):
        columns = scores.design.candidates[k].columns
        for channel in scores.design.candidates[k].channels:
            gram, place = scores.total.grams[channel], scores.design.position[channel, columns[0]]
            gram[place, :] = gram[:, place] = 0.0
    assert np.isfinite([scores.recurring(int(k), []) for k in np.flatnonzero(scores.is_map[scores.owner])]).all()


def test_what_acts_in_moments_is_elsewhere_in_the_slow_motion(body: RigidBody, make_periodic: Periodic) -> None:
    """As a gap that is crossed where a torque changes its sign; a smooth law has all of itself there."""
    evidence = gather(body, served(body, make_periodic, nothing), 0.05)
    (_, slow), design, there = other_errors(evidence), evidence.design, {}
    for name in ("backlash", "viscous_friction"):
        own = design.with_candidates([design.candidates[best_of(scores_of(evidence), name, 1)]])
        (part,) = own.candidates
        among, within = slow.among(own), slow.within(own, part, np.ones(1))
        places = [(channel, own.position[channel, part.columns[0]]) for channel in part.channels]
        energy = [float(among.grams[channel][k, k]) for channel, k in places]
        assert energy == [float(within.grams[channel][k, k]) for channel, k in places]
        there[name] = sum(float(within.grams[channel][k, -1]) for channel, k in places) / sum(energy)
    assert there["backlash"] < 0.98
    assert there["viscous_friction"] == pytest.approx(1.0, abs=0.01)


def test_what_changes_with_time_goes_with_the_torques(body: RigidBody, make_periodic: Periodic) -> None:
    """One recording in which the motion is played six times while friction falls."""
    random = np.random.default_rng(1)
    t, q, dq, ddq = make_periodic(2, 6.0, RATE, 0)
    t, q, dq, ddq = (np.concatenate([t + 6.0 * k for k in range(6)]), *(np.tile(x, (6, 1)) for x in (q, dq, ddq)))
    falling = np.array([0.0, 1.0]) * np.exp(-t / 12.0)[:, None] * np.tanh(dq / 0.01)
    tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + falling + 0.05 * random.normal(size=q.shape)
    recording = Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau)
    scores = scores_of(gather(body, [recording], 0.05))
    drift = best_of(scores, "friction_drift", 1)
    assert scores.gains([])[drift] > 50.0
    assert scores.recurring(drift, []) == pytest.approx(1.0, abs=0.1)


def test_each_playing_gets_the_next_ones_residual(body: RigidBody, make_periodic: Periodic) -> None:
    evidence = gather(body, served(body, make_periodic, friction, error_rad=1e-7), 0.05)
    mixed = exchange(evidence.pieces, evidence.repeats, evidence.grid, evidence.noise)
    assert len(mixed.pieces) >= len(evidence.pieces) == 6
    for piece in mixed.pieces:
        law = friction(piece.signals.dq)
        assert np.corrcoef(piece.residual[:, 1], law[:, 1])[0, 1] > 0.95
        assert np.std(piece.residual[:, 1] - law[:, 1]) < 0.2
    assert not exchange(evidence.pieces, [], evidence.grid, evidence.noise).pieces
    brief = [replace(group, duration=1.0) for group in evidence.repeats]
    assert not exchange(evidence.pieces, brief, evidence.grid, evidence.noise).pieces
