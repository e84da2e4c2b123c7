"""A motor that gives less than is measured, of a joint whose friction takes much of what it gives."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.arm_model import ArmModel, FittedEffect
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming import judging
from estimator.diagnosis.naming.motors_torque import spent_by, still_given
from estimator.diagnosis.observed.spending import spending
from estimator.diagnosis.telling.answer import Diagnosis
from estimator.effects import Place

Array = NDArray[np.float64]
Curve = Callable[[Array], Array]
JOINT, LEVEL, SLOPE = 1, 3.0, 1.5
"""N·m and N·m·s/rad: half of what the links need, or more."""


def dead(tau: Array) -> Array:
    """What is measured of a motor that gives nothing for the first 1.5 N·m."""
    return np.asarray(tau + 1.5 * np.tanh(tau / 0.05))


def saturating(tau: Array) -> Array:
    """Likewise, of one that comes to 30 N·m and no farther."""
    return np.asarray(30.0 * np.arctanh(np.clip(tau / 30.0, -0.97, 0.97)))


def recordings(
    body: RigidBody, make_periodic: Callable[..., tuple[Array, ...]], measured: Curve
) -> tuple[list[Trajectory], Array]:
    """Three motions, each twice; and the rms of the joint's torque."""
    random, result, torques = np.random.default_rng(3), [], []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(body.n, 6.0, 200.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, JOINT] += LEVEL * np.tanh(dq[:, JOINT] / 0.01) + SLOPE * dq[:, JOINT]
        torques.append(tau[:, JOINT].copy())
        tau[:, JOINT] = measured(tau[:, JOINT])
        noise = 0.01 * np.std(tau, axis=0)
        result += [Trajectory(t, q, tau + noise * random.normal(size=q.shape)) for _ in range(2)]
    return result, np.concatenate(torques)


def named(found: Diagnosis) -> set[tuple[str, int | None]]:
    return {(one.effect, one.place.joint) for one in found.findings}


@pytest.mark.parametrize(
    ("measured", "name", "value"), [(dead, "dead_zone", 1.5), (saturating, "limit", 30.0)], ids=["dead", "saturating"]
)
def test_what_a_motor_loses_goes_with_friction_too(
    make_chain: Callable[..., RigidBody],
    make_periodic: Callable[..., tuple[Array, ...]],
    monkeypatch: pytest.MonkeyPatch,
    measured: Curve,
    name: str,
    value: float,
) -> None:
    body = make_chain("rr")
    recorded, torque = recordings(body, make_periodic, measured)
    assert np.abs(torque).max() < 0.97 * 30.0
    found = diagnose(body, recorded)
    truth = {("torque_nonlinearity", JOINT), ("coulomb_friction", JOINT), ("viscous_friction", JOINT)}
    assert named(found) == truth, found.findings
    assert not found.unexplained
    loss = next(one for one in found.findings if one.effect == "torque_nonlinearity").parameters[name]
    assert float(loss.value) == pytest.approx(value, rel=0.05)
    monkeypatch.setattr(judging, "with_motors_torque", lambda *_: None)
    by_links = diagnose(body, recorded)
    assert named(by_links) != truth or by_links.unexplained


def test_a_model_s_motor_loses_of_all_that_it_gives(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, ...]]
) -> None:
    """Whatever the order of its effects; an offset of the measurement is no torque of the motor."""
    body = make_chain("rr")
    t, q, dq, ddq = make_periodic(body.n, 6.0, 200.0, 0)
    tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
    place = Place(JOINT)
    rubs = FittedEffect("coulomb_friction", place, {"level": LEVEL}, shape=np.array([0.01]))
    loses = FittedEffect("torque_nonlinearity", place, {"limit": 30.0})
    reads = FittedEffect("torque_offset", place, {"offset": 2.0})
    rubbing = ArmModel(body, (rubs,)).torque(q, dq, ddq, t)
    expected = rubbing.copy()
    expected[:, JOINT] = saturating(rubbing[:, JOINT]) + 2.0
    for effects in ((rubs, loses, reads), (reads, loses, rubs)):
        np.testing.assert_allclose(ArmModel(body, effects).torque(q, dq, ddq, t), expected, atol=1e-6)
    assert np.abs(rubbing - tau).max() > 1.0


def test_what_goes_with_friction_does_not_stand_without_it(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, ...]]
) -> None:
    """A ripple of no period, of a friction that is taken for given, is that friction."""
    body = make_chain("rr")
    recorded, _ = recordings(body, make_periodic, lambda tau: tau)
    evidence = gather(body, recorded, 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)

    def one(name: str) -> int:
        laws = enumerate(scores.hypothesis(k) for k in range(len(scores.owner)))
        return next(k for k, law in laws if law.effect.name == name and law.place.joint == JOINT)

    rubbing = [one("coulomb_friction"), one("viscous_friction")]
    spent = tuple(spent_by(fitted(evidence, scores, rubbing)))
    assert [own.law.name for own in spent] == ["coulomb_friction", "viscous_friction"]
    beside = replace(evidence, pieces=tuple(spending(evidence.pieces, spent)), spent=spent)
    assert still_given(beside, fitted(beside, scores, [*rubbing, one("torque_ripple")]))
    assert not still_given(beside, fitted(beside, scores, [one("torque_ripple")]))
    assert still_given(beside, fitted(beside, scores, []))
