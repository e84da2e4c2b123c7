"""Laws whose shape lies between the points of their grids, and what stands in their stead until it is found."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.search import Search
from estimator.diagnosis.telling.answer import Finding
from estimator.kinematics import tip_jacobian

Array = NDArray[np.float64]
Play = Callable[..., list[Trajectory]]


def only(findings: tuple[Finding, ...], effect: str) -> Finding:
    assert [finding.effect for finding in findings] == [effect], findings
    return findings[0]


def near(finding: Finding, name: str, truth: float | Array, errors: float = 3.5) -> bool:
    told = finding.parameters[name]
    return bool(np.all(np.abs(told.value - np.array(truth)) < errors * np.array(told.standard_error)))


def test_friction_that_falls_with_speed_is_no_dry_and_viscous_one(
    make_chain: Callable[..., RigidBody], play_twice: Play
) -> None:
    """A viscous friction of the wrong sign makes much of its torque, and is no special case of it."""
    body = make_chain("rr")

    def falling(q: Array, dq: Array) -> Array:
        return np.array([1.0, 0.0]) * (1.0 + 0.8 * np.exp(-((dq / 1.2) ** 2))) * np.tanh(dq / 0.005)

    evidence = gather(body, play_twice(body, falling, noise=0.5), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)
    own = [k for k in range(len(scores.owner)) if scores.hypothesis(k).effect.name == "stribeck_friction"]
    stribeck = max(own, key=lambda k: float(scores.gains([])[k]))
    search = Search(scores)
    plainer = search.specials.of(stribeck, [stribeck])
    assert [scores.hypothesis(k).effect.name for k in plainer] == ["coulomb_friction"]
    finding = only(diagnose(body, play_twice(body, falling, noise=0.5)).findings, "stribeck_friction")
    assert near(finding, "level", 1.0)
    assert near(finding, "breakaway", 1.8)


@pytest.mark.parametrize(("begin", "end"), [(1.83, 2.33), (2.1, 3.7)])
def test_a_push_has_its_own_time(
    make_chain: Callable[..., RigidBody], play_twice: Play, begin: float, end: float
) -> None:
    """Wherever it begins between those that are tried."""
    body, force = make_chain("rrr"), np.array([3.0, -2.0, 1.0])

    def pushed(q: Array, dq: Array) -> Array:
        t = np.arange(len(q)) / 200.0
        during = (t > begin) & (t < end)
        return -1.0 * during[:, None] * (tip_jacobian(body, q) @ force)

    found = diagnose(body, play_twice(body, pushed, noise=0.5))
    finding = only(found.findings, "contact")
    np.testing.assert_allclose(finding.parameters["where"].value, [begin, end], atol=0.02)
    assert near(finding, "force", force)
    assert found.verdict == "named"


@pytest.mark.parametrize("share", [0.0, 0.25])
def test_a_motor_that_is_a_part_of_the_model_s_link_swings_on_none_of_it(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, ...]], share: float
) -> None:
    """A model that was identified holds the rotors: what winds up the spring is the link's torque alone."""
    body, stiffness, joint = make_chain("rr"), 6000.0, 0
    random, recordings = np.random.default_rng(2), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(body.n, 5.0, 200.0, motion)
        rigid = inverse_dynamics(body, body.prior(), q, dq, ddq)
        rotor = share * float(np.mean(inertia_of(body, joint, q)))
        # By iteration, exact but for what a give of a thousandth of a radian bends.
        linked = [q.copy(), dq.copy(), ddq.copy()]
        for _ in range(3):
            torque = inverse_dynamics(body, body.prior(), *linked)[:, joint] - rotor * linked[2][:, joint]
            give = np.stack([torque, np.gradient(torque, t), np.gradient(np.gradient(torque, t), t)]) / stiffness
            for order, x in enumerate((q, dq, ddq)):
                linked[order][:, joint] = x[:, joint] - give[order]
        tau = inverse_dynamics(body, body.prior(), *linked)
        tau[:, joint] += rotor * give[2]
        assert 0.05 < np.abs(tau - rigid).max() < 5.0, (np.abs(tau - rigid).max(), np.abs(give[0]).max())
        recordings += [Trajectory(t, q, tau + 0.02 * random.normal(size=q.shape)) for _ in range(2)]
    finding = only(diagnose(body, recordings).findings, "joint_elasticity")
    assert finding.parameters["stiffness"].value == pytest.approx(stiffness, rel=0.1)


def inertia_of(body: RigidBody, joint: int, q: Array) -> Array:
    """(samples,) kg·m² that a joint feels of everything it carries."""
    still, one = np.zeros_like(q), np.zeros_like(q)
    one[:, joint] = 1.0
    moved, held = (inverse_dynamics(body, body.prior(), q, still, x) for x in (one, still))
    return (moved - held)[:, joint]


@pytest.mark.parametrize("stiffness", [500.0, 1500.0])
def test_a_joint_gives_as_it_is_stiff_wherever_the_grid_has_its_resonance(
    make_chain: Callable[..., RigidBody],
    make_periodic: Callable[..., tuple[Array, Array, Array, Array]],
    stiffness: float,
) -> None:
    """The truth is made from the link's side: the motor is ahead of a given link by what the link's torque winds up."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(2), []
    relaxation, joint = 2e-3, 1
    for motion in range(3):
        t, *link = make_periodic(2, 4.0, 500.0, motion)
        tau = inverse_dynamics(body, body.prior(), *link)
        w = 2j * np.pi * np.fft.rfftfreq(len(t), t[1])
        wound = np.fft.irfft(np.fft.rfft(tau[:, joint]) / (stiffness * (1.0 + relaxation * w)), len(t))
        motor = link[0] + wound[:, None] * (np.arange(2) == joint)
        for _ in range(2):
            noise = 0.005 * np.std(tau, axis=0)
            measured = motor + 1e-6 * random.normal(size=motor.shape)
            recordings.append(Trajectory(t, measured, tau + noise * random.normal(size=tau.shape)))
    finding = only(diagnose(body, recordings).findings, "joint_elasticity")
    assert finding.place.joint == joint
    assert near(finding, "stiffness", stiffness)
    assert float(finding.parameters["stiffness"].standard_error) < 0.02 * stiffness
