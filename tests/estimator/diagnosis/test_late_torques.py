"""Torques that are recorded late, of joints that rub far above their noise: the friction is as late as the rest."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from config import load_installation
from estimator import RigidBody, Trajectory, inverse_dynamics, load_rigid_body
from estimator.arm_model import ArmModel, FittedEffect
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.late_torques import with_late_torques
from estimator.effects import Lateness, Place, Signals
from estimator.effects.transport_delay import LATE as TIME_ALONE
from estimator.effects.transport_delay import SECOND_ORDER

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]
LATE, RATE, NOISE = 0.012, 500.0, 0.05
LEVELS, VISCOUS = np.array([1.5, 2.0, 0.8]), np.array([0.8, 0.0, 0.5])


def recorded(body: RigidBody, make_periodic: Periodic, late: Array) -> list[Trajectory]:
    """Three motions, each played twice, of three joints whose torques are late by so many s (n,)."""
    random, recordings = np.random.default_rng(3), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(3, 8.0, RATE, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau += LEVELS * np.tanh(dq / 0.01) + VISCOUS * dq
        # Periodic, so that it is known before its first sample too.
        whole = CubicSpline(np.append(t, t[-1] + 1.0 / RATE), np.vstack([tau, tau[:1]]), bc_type="periodic")
        tau = np.stack([whole(t - own)[:, k] for k, own in enumerate(late)], axis=1)
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + NOISE * random.normal(size=q.shape)))
    return recordings


@pytest.mark.parametrize("joint", [None, 1])
def test_frictions_are_named_as_they_are(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic, joint: int | None
) -> None:
    """Beside the angles of the same moment they were bristles, and rises from rest."""
    body = make_chain("rrr")
    late = np.where([joint in (None, k) for k in range(3)], LATE, 0.0)
    found = diagnose(body, recorded(body, make_periodic, late))
    told = {(f.effect, f.place.joint): f for f in found.findings}
    expected = {("coulomb_friction", k) for k in range(3)} | {("viscous_friction", 0), ("viscous_friction", 2)}
    assert set(told) == expected | {("transport_delay", joint)}
    assert not found.unexplained
    truth = {("coulomb_friction", k): ("level", LEVELS[k]) for k in range(3)}
    truth |= {("viscous_friction", k): ("coefficient", VISCOUS[k]) for k in (0, 2)}
    truth[("transport_delay", joint)] = ("delay", LATE)
    for cause, (name, true) in truth.items():
        parameter = told[cause].parameters[name]
        assert abs(float(parameter.value) - true) < max(3.0 * float(parameter.standard_error or 0.0), 0.02 * true)


def test_angles_that_are_late_make_frictions_early(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    body, random, recordings = make_chain("rrr"), np.random.default_rng(5), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(3, 8.0, RATE, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + LEVELS * np.tanh(dq / 0.01)
        whole = CubicSpline(np.append(t, t[-1] + 1.0 / RATE), np.vstack([q, q[:1]]), bc_type="periodic")(t - LATE)
        for _ in range(2):
            measured = whole + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + NOISE * random.normal(size=q.shape)))
    found = {(f.effect, f.place.joint): f for f in diagnose(body, recordings).findings}
    assert set(found) == {("coulomb_friction", k) for k in range(3)} | {("transport_delay", None)}
    delay = found["transport_delay", None]
    assert delay.place.channel == "position"
    assert float(delay.parameters["delay"].value) == pytest.approx(LATE, rel=0.02)


def test_torques_through_a_filter_are_late_alike(make_periodic: Periodic) -> None:
    """A filter of the first order is no delay; what it leaves of one was told as a delay of each joint besides."""
    installation = load_installation("seven")
    urdf = installation.path.parent / installation.arm.urdf
    body, late = load_rigid_body(urdf.read_text(), installation.joint_names), 0.008
    levels, viscous = np.array([0.5, 0.6, 0.4, 1.5, 0.7, 0.3, 0.4]), np.array([0.6, 0.0, 0.0, 0.5, 0.0, 0.0, 0.0])
    random, recordings = np.random.default_rng(4), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(7, 6.0, RATE, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        noise = 0.01 * np.sqrt(np.mean(tau**2, axis=0))
        kept = np.exp(-1.0 / (RATE * late))
        tau += levels * np.tanh(dq / 0.03) + viscous * dq
        tau = lfilter([1.0 - kept], [1.0, -kept], np.vstack([tau, tau]), axis=0)[len(t) :]
        for _ in range(2):
            measured = q + 1e-5 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + noise * random.normal(size=q.shape)))
    delays = [f for f in diagnose(body, recordings).findings if f.effect == "transport_delay"]
    assert [(f.place.joint, f.place.channel) for f in delays] == [(None, "torque")]
    assert float(delays[0].parameters["delay"].value) == pytest.approx(late, rel=0.2)


def through_a_filter(x: Array, delay: float) -> Array:
    """Butterworth's of second order, of a channel (samples, …) that repeats."""
    s = 2j * np.pi * np.fft.rfftfreq(len(x), 1.0 / RATE)[:, None]
    return np.fft.irfft(np.fft.rfft(x, axis=0) / (1.0 + delay * s + 0.5 * (delay * s) ** 2), len(x), axis=0)


def test_friction_behind_a_filter_is_named_as_it_is(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """It turns over as slowly as the filter lets it, which no law of friction does."""
    body, random, recordings = make_chain("rrr"), np.random.default_rng(6), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(3, 8.0, RATE, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + LEVELS * np.tanh(dq / 0.01) + VISCOUS * dq
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(
                Trajectory(t, measured, through_a_filter(tau, LATE) + NOISE * random.normal(size=q.shape))
            )
    told = {(f.effect, f.place.joint): f for f in diagnose(body, recordings).findings}
    expected = {("coulomb_friction", k) for k in range(3)} | {("viscous_friction", 0), ("viscous_friction", 2)}
    assert set(told) == expected | {("transport_delay", None)}
    for k in range(3):
        assert float(told["coulomb_friction", k].parameters["level"].value) == pytest.approx(LEVELS[k], rel=0.01)
    assert float(told["transport_delay", None].parameters["delay"].value) == pytest.approx(LATE, rel=0.02)


def test_a_model_s_torque_goes_through_its_filter(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    body = make_chain("rrr")
    t, *motion = make_periodic(3, 8.0, RATE, 4)
    friction = FittedEffect("viscous_friction", Place(1), {"coefficient": 4.0})
    delay = FittedEffect("transport_delay", Place(channel="torque"), {"delay": LATE}, shape=np.array([SECOND_ORDER]))
    prompt = ArmModel(body, (friction,)).torque(*motion, t)
    found = ArmModel(body, (friction, delay)).torque(*motion, t)
    settled = slice(200, -1)
    np.testing.assert_allclose(
        found[settled], through_a_filter(prompt, LATE)[settled], atol=1e-4 * np.abs(prompt).max()
    )


def test_a_model_s_torque_is_late_with_all_that_it_holds(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    body = make_chain("rrr")
    t, *motion = make_periodic(3, 8.0, RATE, 4)
    friction = FittedEffect("viscous_friction", Place(1), {"coefficient": 4.0})
    delay = FittedEffect("transport_delay", Place(channel="torque"), {"delay": LATE})
    prompt = ArmModel(body, (friction,)).torque(*motion, t)
    expected = CubicSpline(t, prompt)(t - LATE)
    found = ArmModel(body, (friction, delay)).torque(*motion, t)
    inner = slice(20, None)
    np.testing.assert_allclose(found[inner], expected[inner], atol=1e-4 * np.abs(prompt).max())
    early = FittedEffect("transport_delay", Place(channel="position"), {"delay": LATE})
    found = ArmModel(body, (friction, early)).torque(*motion, t)
    np.testing.assert_allclose(found[:-20], CubicSpline(t, prompt)(t + LATE)[:-20], atol=1e-4 * np.abs(prompt).max())


@pytest.mark.parametrize("whole_drive", [False, True])
def test_a_model_predicts_torques_beside_one_late_angle(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic, whole_drive: bool
) -> None:
    """The links' torques, and the friction of the joint whose angle it is, are those of its true motion."""
    body = make_chain("rrr")
    t, *motion = make_periodic(3, 8.0, RATE, 5)
    own = LATE * (np.arange(3) == 1)
    recorded = [np.array([CubicSpline(t, c)(t - by) for c, by in zip(x.T, own, strict=True)]).T for x in motion]
    friction = FittedEffect("viscous_friction", Place(1), {"coefficient": 20.0})
    late = [FittedEffect("transport_delay", Place(1, channel="position"), {"delay": LATE})]
    expected = ArmModel(body, (friction,)).torque(*motion, t)
    if whole_drive:
        late.append(FittedEffect("transport_delay", Place(1, channel="torque"), {"delay": LATE}))
        expected[:, 1] = CubicSpline(t, expected[:, 1])(t - LATE)
    found = ArmModel(body, (friction, *late)).torque(*recorded, t)
    inner = slice(20, -20)
    np.testing.assert_allclose(found[inner], expected[inner], atol=2e-4 * np.abs(expected).max())


def test_the_motion_as_it_was_recorded_stays_beside_the_one_that_torques_answer_to(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    t, *motion = make_periodic(3, 8.0, RATE, 5)
    signals = Signals.of_motion(make_chain("rrr"), t, *motion)
    late = signals.answering_to(Lateness(np.array([0.0, 0.01, 0.01]), np.zeros(3)))
    np.testing.assert_array_equal(late.q[:, 0], signals.q[:, 0])
    np.testing.assert_allclose(late.q[5:, 1:], signals.q[:-5, 1:], atol=1e-9)
    part = late.part(slice(100, 200), t[100:200])
    np.testing.assert_array_equal(part.as_recorded.q, signals.q[100:200])
    np.testing.assert_array_equal(part.q, late.q[100:200])
    assert signals.as_recorded is signals


def test_laws_are_as_late_as_a_delay_is_whatever_the_shape_that_it_was_fitted_with(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """A shape of 25 ms may fit a smaller delay no worse; laws that came late by 25 fitted nothing."""
    body = make_chain("rrr")
    evidence = gather(body, recorded(body, make_periodic, np.full(3, LATE)), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    gains = scores.gains([])

    def best(effect: str, joint: int | None, channel: str | None = None) -> int:
        place = Place(joint, channel=channel)
        own = [k for k in range(len(gains)) if (h := scores.hypothesis(k)).effect.name == effect and h.place == place]
        own = [k for k in own if channel is None or evidence.design.candidates[k].theta[1] == TIME_ALONE]
        return max(own, key=lambda k: gains[k])

    chosen = [best("transport_delay", None, "torque"), *(best("coulomb_friction", k) for k in range(3))]
    refined = fitted(evidence, scores, chosen)
    shapes = [
        replace(c, theta=np.array([0.025, TIME_ALONE])) if n == 0 else c
        for n, c in enumerate(refined.design.candidates)
    ]
    answering = with_late_torques(
        evidence, scores, chosen, replace(refined, design=refined.design.with_candidates(shapes))
    )
    assert answering is not None
    assert answering.late is not None
    np.testing.assert_allclose(answering.late.delay, float(refined.design.candidates[0].theta[0]), rtol=0.05)
