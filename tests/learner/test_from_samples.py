"""What is taken from samples: kinematics, linearisation, velocity sensors, the trial filter, timing."""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import numpy as np
import pytest

from config import InputError
from learner.cosine_spectrum import frequencies, low_pass, to_history, to_lines
from learner.kinematics import Kinematics
from learner.linearisation import linearise
from learner.local_model import LocalModel, States
from learner.trial import Reference, Timing, Trial
from learner.trial_filter import TrialFilter, noise_of
from learner.velocity_sensor import calibrate, from_angles

H = 1e-3


def test_mid_sample_acceleration_is_the_mean_one() -> None:
    t = np.arange(50)[:, None] * H
    q, dq, ddq = Kinematics(H, held=True, flat_hz=None).at_torques(3.0 * t**2, 6.0 * t)
    np.testing.assert_allclose(ddq[1:], 6.0, rtol=1e-9)
    np.testing.assert_allclose(dq[1:, 0], 6.0 * (t[1:, 0] - H / 2), rtol=1e-9)
    assert q.shape == dq.shape == ddq.shape


def test_the_low_pass_leaves_what_is_below_it() -> None:
    t = np.arange(2000)[:, None] * H
    window = np.sin(np.pi * t / 2.0) ** 2
    dq = window * np.cos(2 * np.pi * 20.0 * t)
    inner = slice(300, -300)
    _, smooth, ddq = Kinematics(H, held=False, flat_hz=60.0).at_torques(np.cumsum(dq, axis=0) * H, dq)
    np.testing.assert_allclose(smooth[inner], dq[inner], atol=1e-3)
    np.testing.assert_allclose(ddq[inner], np.gradient(dq, H, axis=0)[inner], atol=0.6)


def test_linearisation_has_the_mass_matrix(planar_model: Any, motion: Callable[..., Reference]) -> None:
    reference = motion((0.0, 90.0), (90.0, 17.0), 1.0, 2e-3)
    at = np.array([0, 120, 300])
    arm = linearise(planar_model, reference.q[at], reference.dq[at], reference.ddq[at])
    c = np.cos(reference.q[at, 1])
    off = 1 / 3 + 0.5 * c
    expected = np.array([[5 / 3 + c, off], [off, np.full(3, 1 / 3)]]).transpose(2, 0, 1)
    np.testing.assert_allclose(arm.inertia, expected, atol=1e-9)
    # Coriolis: ∂τ₁/∂q̇₁ = −sin(q₂)·q̇₂.
    np.testing.assert_allclose(arm.damping[:, 0, 0], -np.sin(reference.q[at, 1]) * reference.dq[at, 1], atol=1e-9)


@pytest.mark.parametrize(("gain", "offset"), [(1.0, 0.0), (1.03, -0.02)])
def test_velocity_sensors_are_made_consistent(gain: float, offset: float, motion: Callable[..., Reference]) -> None:
    reference = motion((0.0, 90.0), (90.0, 17.0), 1.0, H, 100)
    rng = np.random.default_rng(4)
    shape = reference.q.shape

    def replay() -> Trial:
        dq = gain * reference.dq + offset + 3e-3 * rng.standard_normal(shape)
        return Trial(reference.q + 3e-5 * rng.standard_normal(shape), dq, np.zeros(shape))

    replays = [replay() for _ in range(5)]
    found = calibrate(replays, reference)
    np.testing.assert_allclose(found.gain, gain, atol=1e-3)
    np.testing.assert_allclose(found.offset, offset, atol=1e-3)
    if gain == 1.0:
        np.testing.assert_array_equal(found.gain, 1.0)
    mean = np.mean([found.apply(trial).dq - reference.dq for trial in replays], axis=0)
    assert np.abs(mean.mean(axis=0)).max() < 1e-3


def test_counts_alone_give_velocities_in_time(motion: Callable[..., Reference]) -> None:
    """An encoder of 1e-4 rad at 500 Hz: differences are half a sample late and jump by 0.05 rad/s."""
    reference = motion((0.0, 90.0), (90.0, 0.0), 2.0, 2e-3, 40)
    wobble = 2e-3 * np.sin(2 * np.pi * 3.0 * np.arange(reference.samples) * 2e-3)[:, None] * np.ones(2)
    true = reference.dq + np.gradient(wobble, 2e-3, axis=0)
    q = np.round((reference.q + wobble) / 1e-4) * 1e-4
    dq = np.diff(q, axis=0, prepend=q[:1]) / 2e-3
    found = from_angles(Trial(q, dq, q), reference, np.array([True, False]), 40.0)
    raw, made = (np.sqrt(np.mean((x - true)[reference.moving] ** 2, axis=0)) for x in (dq, found.dq))
    assert raw.min() > 0.015
    assert made[0] < 0.003
    np.testing.assert_array_equal(found.dq[:, 1], dq[:, 1])


def test_the_trial_filter_averages_noise_and_believes_news() -> None:
    samples, rng = 1500, np.random.default_rng(6)
    frequency = frequencies(samples, H)
    lines = rng.standard_normal((samples, 1)) * low_pass(frequency, 8.0)[:, None]
    need = to_history(lines)

    def measured() -> Any:
        return need + 0.3 * rng.standard_normal(need.shape)

    noise = noise_of(np.array([measured() for _ in range(6)]))
    assert noise.mean() == pytest.approx(0.09, rel=0.1)
    update = TrialFilter(frequency, noise, band_hz=50.0)
    errors = []
    for _ in range(10):
        update.take(measured())
        errors.append(float(np.sqrt(np.mean((update.correction - need) ** 2))))
    assert errors[-1] < 0.6 * errors[0]
    one_trial = to_history(low_pass(frequency, 50.0)[:, None] * to_lines(measured() - need))
    assert errors[-1] < 0.5 * float(np.sqrt(np.mean(one_trial**2)))
    need = 0.5 * need
    before = float(np.sqrt(np.mean((update.correction - need) ** 2)))
    for _ in range(2):
        update.take(measured())
    assert float(np.sqrt(np.mean((update.correction - need) ** 2))) < 0.5 * before


def test_a_joint_that_never_moved_is_left_to_the_model() -> None:
    t = np.linspace(0.0, 1.0, 200)
    still = np.zeros_like(t)
    states = States(
        np.column_stack([t**2, still]), np.column_stack([2 * t, still]), np.column_stack([2 + still, still])
    )
    correction = np.column_stack([np.ones_like(t), 5.0 * np.ones_like(t)])
    found, trust = LocalModel(states, correction).correction_at(states)
    assert found[50:, 0] == pytest.approx(1.0)
    assert not found[:, 1].any()
    assert not trust[:, 1].any()
    with pytest.raises(InputError, match="shape"):
        LocalModel(states, correction[:-1])


def test_commands_go_ahead_of_their_action() -> None:
    torque = np.column_stack([np.arange(10.0), 2.0 * np.arange(10.0)])
    sent = Timing(held=True, advance=np.array([2.0, 0.5])).command(torque)
    np.testing.assert_allclose(sent[:7], np.column_stack([torque[2:9, 0], torque[:7, 1] + 1.0]))
    np.testing.assert_allclose(sent[-1], torque[-1])
