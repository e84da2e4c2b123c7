"""Laws that go with the model's torque, where the given links are off within their tolerance."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.deciding.contest import contest
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import cut, gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming import judging
from estimator.diagnosis.naming.bent_links import bent
from estimator.diagnosis.observed.stretches import make_grid
from estimator.diagnosis.telling.answer import Finding

Array = NDArray[np.float64]
ORDER, AMPLITUDE = 4.0, 0.1


@pytest.fixture(scope="module")
def body(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rr")


@pytest.fixture(scope="module")
def true(body: RigidBody) -> Array:
    """Both centres are off by some per cent of their distances, so that the joints' weights are."""
    parameters = body.prior().reshape(-1, 10).copy()
    for link, shift in zip(parameters, (0.04, -0.06), strict=True):
        link[1:4] += shift * np.linalg.norm(link[1:4]) * np.array([0.7, 0.5, -0.5])
    return parameters.ravel()


@pytest.fixture(scope="module")
def recordings(
    body: RigidBody, true: Array, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> list[Trajectory]:
    """The second joint's torque ripples."""
    random, result = np.random.default_rng(5), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(body.n, 5.0, 200.0, motion)
        tau = inverse_dynamics(body, true, q, dq, ddq)
        tau[:, 1] *= 1.0 + AMPLITUDE * np.sin(ORDER * q[:, 1] + 0.4)
        result += [Trajectory(t, q, tau + 0.4 * random.normal(size=q.shape)) for _ in range(2)]
    return result


def ripple(body: RigidBody, recordings: list[Trajectory]) -> Finding:
    return next(f for f in diagnose(body, recordings).findings if f.effect == "torque_ripple")


def test_a_ripple_is_one_of_the_torque_that_the_links_really_need(
    body: RigidBody, recordings: list[Trajectory], monkeypatch: pytest.MonkeyPatch
) -> None:
    found = diagnose(body, recordings)
    assert [(f.effect, f.place.joint) for f in found.findings] == [("torque_ripple", 1)]
    told = found.findings[0].parameters["amplitude"]
    assert float(told.value) == pytest.approx(AMPLITUDE, rel=0.02)
    assert not found.unexplained
    monkeypatch.setattr(judging, "with_bent_links", lambda *_: None)
    with_given = ripple(body, recordings).parameters["amplitude"]
    assert abs(float(with_given.value) - AMPLITUDE) > 3.0 * abs(float(told.value) - AMPLITUDE)


def test_bent_links_change_what_a_law_looks_at_and_not_what_is_left(
    body: RigidBody, true: Array, recordings: list[Trajectory]
) -> None:
    pieces = cut(body, make_grid(body, recordings), recordings)
    others = bent(pieces, true - body.prior())
    for piece, other in zip(pieces, others, strict=True):
        signals = other.signals
        expected = inverse_dynamics(body, true, signals.q, signals.dq, signals.ddq)
        np.testing.assert_allclose(signals.tau_rigid, expected, atol=1e-9)
        np.testing.assert_allclose(signals.gravity_torque(np.array([0.0, 0.0, -9.81])), weight(body, true, signals.q))
        np.testing.assert_array_equal(other.residual, piece.residual)
    assert all(a.signals is b.signals for a, b in zip(pieces, bent(pieces, None), strict=True))


def weight(body: RigidBody, parameters: Array, q: Array) -> Array:
    return inverse_dynamics(body, parameters, q, np.zeros_like(q), np.zeros_like(q))


@pytest.mark.parametrize("off", [0.0, 1.0])
def test_a_planned_motion_needs_the_torques_of_the_same_links(
    body: RigidBody, true: Array, recordings: list[Trajectory], off: float
) -> None:
    change = off * (true - body.prior())
    evidence = replace(gather(body, recordings, 0.05), bend=change if off else None)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)
    planned = contest(scores, evidence, [], [0, 1])
    np.testing.assert_allclose(planned.body.prior(), body.prior() + change, atol=1e-12)
