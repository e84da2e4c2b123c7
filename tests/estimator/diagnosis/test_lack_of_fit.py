"""What a model leaves is told without a law's name: bent friction, nothing on a clean arm, and no more than chance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.maps import smoothest_first, stops
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.lack_of_fit import _DEPTHS, Misfit, _forms_of, _surprise, misfits

Array = NDArray[np.float64]
Record = Callable[[Callable[[Array], Array]], list[Trajectory]]


@pytest.fixture(scope="module")
def body(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rr")


@pytest.fixture(scope="module")
def record(body: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]) -> Record:
    """Three motions of two joints, each played twice, with friction of the speeds."""
    return recorder(body, make_periodic, lambda friction, q, dq: friction(dq))


@pytest.fixture(scope="module")
def record_along(body: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]) -> Record:
    """The same, with a force of the angles that were passed."""
    return recorder(body, make_periodic, lambda force, q, dq: force(q))


def recorder(
    body: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]], torque: Callable[..., Array]
) -> Record:
    def make(law: Callable[[Array], Array]) -> list[Trajectory]:
        random, recordings = np.random.default_rng(3), []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + torque(law, q, dq)
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + 0.2 * random.normal(size=q.shape)))
        return recordings

    return make


def test_a_law_that_is_not_the_catalogue_s_is_flagged_beside_the_one_that_it_resembles(
    body: RigidBody, record: Record
) -> None:
    """Drag by the square of the speed is five parts in six viscous friction."""
    found = diagnose(body, record(lambda dq: np.array([0.01, 0.0]) * np.abs(dq) * dq))
    assert found.verdict == "unknown"
    assert list(found.unexplained) == [0]
    assert found.unexplained[0].signature == "a function of speed"
    assert 0.02 < found.unexplained[0].share < 0.6


def test_the_form_of_a_law_that_was_named_is_asked_first(body: RigidBody, record: Record) -> None:
    """Viscous friction that rises a little with the speed: among all maps of all joints it would be chance."""
    found = diagnose(body, record(lambda dq: np.array([0.02, 0.0]) * dq + np.array([0.0018, 0.0]) * np.abs(dq) * dq))
    assert [(f.effect, f.place.joint) for f in found.findings] == [("viscous_friction", 0)]
    assert {joint: left.signature for joint, left in found.unexplained.items()} == {0: "a function of speed"}


def test_what_shows_the_form_of_a_law(body: RigidBody, record: Record) -> None:
    evidence = gather(body, record(np.zeros_like), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    every = [scores.hypothesis(k) for k in range(len(scores.owner))]
    maps = [k for k in range(len(every)) if scores.is_map[scores.owner[k]]]

    def forms(name: str) -> set[tuple[str, int | None]]:
        law = next(k for k, h in enumerate(every) if h.effect.name == name and h.place.joint == 0)
        return {(every[k].effect.name, every[k].place.joint) for k in _forms_of(scores, maps, [law])}

    assert forms("viscous_friction") == {("map of speed", 0)}
    assert forms("joint_spring") == {("map of angle", 0)}
    assert forms("joint_elasticity") == set()


def test_a_memory_of_reversals_is_no_spring(body: RigidBody, record_along: Record) -> None:
    """A dress pack: nine parts in ten of its force yield within 0.3 rad, which a spring and friction resemble."""

    def pack(q: Array) -> Array:
        force, memory = np.zeros_like(q), 0.0
        for k, step in enumerate(np.diff(q[:, 0])):
            memory += step / 0.3 * (1.0 - memory**2 if step * memory > 0.0 else 1.0)
            force[k + 1, 0] = 0.27 * memory + 0.1 * (q[k + 1, 0] - q[0, 0])
        return force

    found = diagnose(body, record_along(pack))
    assert found.verdict == "unknown"
    assert found.unexplained[0].signature.startswith("a function of travel since reversals")


def test_stops_yield_at_their_width_and_take_up_again_at_a_reversal() -> None:
    q = np.array([0.0, 0.1, 0.3, 0.2, -0.4, -0.4, -0.3])
    small, large = stops(q, np.array([0.2, 1.0])).T
    np.testing.assert_allclose(small, [0.0, 0.5, 1.0, 0.5, -1.0, -1.0, -0.5])
    np.testing.assert_allclose(large, q, atol=1e-15)
    np.testing.assert_array_equal(stops(np.ones(3), np.array([0.2])), np.zeros((3, 1)))


def test_a_named_law_that_fits_leaves_nothing(body: RigidBody, record: Record) -> None:
    found = diagnose(body, record(lambda dq: np.array([0.5, 0.0]) * dq))
    assert [(f.effect, f.place.joint) for f in found.findings] == [("viscous_friction", 0)]
    assert found.verdict == "named" and not found.unexplained


def test_a_clean_arm_has_no_misfit(body: RigidBody, record: Record) -> None:
    evidence = gather(body, record(np.zeros_like), 0.05)
    found = misfits(Scores(evidence.design, evidence.blocks, evidence.folds), [])
    assert set(found) == {0, 1}
    assert not any(misfit.told for misfit in found.values())
    assert all(misfit.false_alarm > 0.05 for misfit in found.values())


def test_what_is_smaller_than_the_noise_is_known_is_not_told() -> None:
    told = Misfit(candidate=0, variance=0.05, false_alarm=1e-4)
    assert told.told
    assert not replace(told, variance=0.005).told
    assert not replace(told, false_alarm=0.01).told


@pytest.mark.parametrize("columns", [8, 9])
def test_smoothest_first_is_another_basis_of_the_same_map(columns: int) -> None:
    shapes = smoothest_first(columns)
    assert np.linalg.matrix_rank(shapes) == columns
    polynomials = np.delete(shapes[:8], 2, axis=1) if columns == 9 else shapes
    for degree in range(7):
        np.testing.assert_allclose(np.diff(polynomials[:, degree], degree + 1), 0.0, atol=1e-10)


def test_chance_surprises_no_more_often_than_it_says() -> None:
    """Over all depths of one map, whose columns overlap as hats do, of noise alone."""
    random = np.random.default_rng(0)
    columns = np.maximum(0.0, 1.0 - np.abs(random.uniform(0, 7, (400, 1)) - np.arange(8)))
    matrix = columns.T @ columns
    told = [_surprise(matrix, columns.T @ random.normal(size=400), np.diag(matrix).copy())[0] for _ in range(600)]
    for probability in (0.2, 0.05, 0.01):
        assert np.mean(np.exp(-np.array(told)) * _DEPTHS < probability) < probability + 2.5 * np.sqrt(probability / 600)


def test_a_direction_that_the_model_has_taken_is_no_surprise() -> None:
    columns = np.random.default_rng(1).normal(size=(200, 8))
    taken = columns[:, :1]
    left = columns - taken @ np.linalg.lstsq(taken, columns, rcond=None)[0]
    residual = np.random.default_rng(2).normal(size=200)
    surprise, _ = _surprise(left.T @ left, left.T @ residual, np.sum(columns**2, axis=0))
    assert 0.0 < surprise < 7.0
