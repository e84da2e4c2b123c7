"""What the wrist sensor adds to the load: delay, offsets, drift, saturation, gaps; the hand, and what was known."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from config import InputError
from estimator.delays import Delay
from estimator.loads import (
    LoadOptions,
    LoadRecording,
    RigidLoad,
    Tare,
    align_wrench,
    identify_load,
    tare,
    wrench_history,
)
from estimator.loads.parameters import rigid_load
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]


def late(arm: Any, seconds: float) -> Array:
    return np.asarray(CubicSpline(arm.t, arm.wrench)(np.clip(arm.t - seconds, 0.0, None)))


@pytest.mark.parametrize("seconds", [-0.003, 0.0042, 0.011])
def test_a_late_sensor_is_found_and_its_load_too(loaded_puma: Any, seconds: float) -> None:
    arm = loaded_puma
    recording = arm.recording(5, wrench=late(arm, seconds))
    found = identify_load(arm.body, "tool", [recording])
    assert abs(found.delay.value - seconds) < 3.5 * found.delay.standard_error
    assert found.delay.standard_error < 5e-4
    assert np.all(np.abs(found.load.inertia.value - arm.inertia) < 4.0 * found.load.inertia.standard_error)
    blind = identify_load(arm.body, "tool", [recording], options=LoadOptions(delay=Delay(0.0, 0.0)))
    assert blind.delay == Delay(0.0, 0.0)
    assert sum(r["rms"] for r in blind.wrench_residual.values()) > sum(r["rms"] for r in found.wrench_residual.values())


def test_a_motion_that_does_not_tell_the_delay_leaves_what_was_believed(loaded_puma: Any) -> None:
    arm = loaded_puma
    slow = CubicSpline(arm.t, arm.q)(arm.t / 30.0 + 2.0)
    wrench = arm.weigh(slow, 0 * slow, 0 * slow)
    noisy = wrench + 30.0 * arm.noise * np.random.default_rng(0).normal(size=wrench.shape)
    recording = LoadRecording(Trajectory(arm.t, slow, 0 * slow), noisy)
    found = identify_load(arm.body, "tool", [recording], options=LoadOptions(delay=Delay(0.004, 0.001)))
    assert found.delay.value == pytest.approx(0.004, abs=0.0015)
    assert found.delay.standard_error == pytest.approx(0.001, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_an_empty_wrist_tells_no_delay(loaded_puma: Any, seed: int) -> None:
    """Nor does interpolation between the shifts, however many samples of noise there are."""
    arm = loaded_puma
    noise = arm.noise * np.random.default_rng(seed).normal(size=(8, *arm.wrench.shape))
    found = identify_load(
        arm.body, "tool", [LoadRecording(Trajectory(arm.t, arm.q, 0 * arm.q), each) for each in noise]
    )
    assert abs(found.delay.value) < 2.5 * found.delay.standard_error
    assert found.delay.standard_error > 2e-3


def test_tares_before_and_after_tell_the_drift(loaded_puma: Any) -> None:
    arm = loaded_puma
    rate = np.array([0.02, -0.01, 0.005, 1e-3, 0.0, -5e-4])
    recording = arm.recording(6, wrench=arm.wrench + np.outer(arm.t + 10.0, rate), start=10.0)
    error = np.array([0.01] * 3 + [3e-4] * 3)
    tares = [Tare(0.0, arm.offset, error), Tare(40.0, arm.offset + 40.0 * rate, error)]
    with_tares = identify_load(arm.body, "tool", [recording], tares=tares, options=LoadOptions(offset="drift"))
    np.testing.assert_allclose(with_tares.drift.value, rate, atol=2e-3)
    without = identify_load(arm.body, "tool", [recording], options=LoadOptions(offset="drift"))
    assert np.all(with_tares.drift.standard_error < 0.5 * without.drift.standard_error)
    assert with_tares.load.mass.standard_error < without.load.mass.standard_error
    with pytest.raises(InputError, match="no common one"):
        identify_load(arm.body, "tool", [recording], tares=tares, options=LoadOptions(offset="each"))


def test_a_tare_takes_the_hand_off(loaded_puma: Any) -> None:
    arm = loaded_puma
    hand = rigid_load(0.4, np.array([0.0, 0.0, 0.03]), np.full(6, 1e-4))
    q = np.tile([0.1, -0.4, 0.9, 0.3, 0.5, 0.0], (400, 1))
    felt = arm.weigh(q[:1], 0 * q[:1], 0 * q[:1], mass=0.4, centre=np.array([0.0, 0.0, 0.03]), inertia=np.full(6, 1e-4))
    noise = arm.noise * np.random.default_rng(1).normal(size=(400, 6))
    still = Trajectory(arm.t[:400], q, 0 * q)
    read = tare(arm.body, "tool", LoadRecording(still, arm.offset + felt + noise), hand)
    assert np.all(np.abs(read.offset - arm.offset) < 4.0 * read.standard_error)
    np.testing.assert_allclose(read.standard_error, arm.noise / 20.0, rtol=0.9)
    moving = LoadRecording(Trajectory(arm.t[300:1500], arm.q[300:1500], 0 * arm.q[300:1500]), arm.wrench[300:1500])
    with pytest.raises(InputError, match="does not rest in this tare"):
        tare(arm.body, "tool", moving)


def test_every_recording_may_have_an_offset_of_its_own(loaded_puma: Any) -> None:
    arm = loaded_puma
    recordings = [
        arm.recording(1),
        arm.recording(2, wrench=arm.wrench + 3.0),
        arm.recording(3, wrench=arm.wrench - 2.0),
    ]
    each = identify_load(arm.body, "tool", recordings, options=LoadOptions(offset="each"))
    assert abs(each.load.mass.value - arm.mass) < 4.0 * each.load.mass.standard_error
    np.testing.assert_allclose(each.offset.value, arm.offset, atol=0.1)
    common = identify_load(arm.body, "tool", recordings)
    assert common.wrench_residual["fx"]["rms"] > 10.0 * each.wrench_residual["fx"]["rms"]
    other = wrench_history(arm.body, "tool", each, arm.recording(4, wrench=arm.wrench + 7.0))
    assert other.residual["fx"]["rms"] < 1.3 * each.wrench_residual["fx"]["rms"]


def test_the_hand_is_subtracted_with_its_errors(loaded_puma: Any) -> None:
    arm = loaded_puma
    covariance = np.diag([0.01, *[1e-4] * 3, *[1e-5] * 6]) ** 2
    hand = rigid_load(0.4, np.array([0.0, 0.0, 0.03]), np.full(6, 1e-4), covariance)
    whole = identify_load(arm.body, "tool", [arm.recording(7)])
    rest = identify_load(arm.body, "tool", [arm.recording(7)], hand=hand)
    np.testing.assert_allclose(rest.load.parameters, whole.load.parameters - hand.parameters)
    assert rest.load.mass.standard_error == pytest.approx(np.hypot(whole.load.mass.standard_error, 0.01))


def test_a_prior_fills_in_what_the_motion_does_not_tell(loaded_puma: Any) -> None:
    arm = loaded_puma
    # One joint turns slowly: no inertia is told.
    t = arm.t
    q = np.zeros((len(t), 6))
    dq, ddq = np.zeros_like(q), np.zeros_like(q)
    q[:, 4], dq[:, 4], ddq[:, 4] = 1.2 * np.sin(0.7 * t), 0.84 * np.cos(0.7 * t), -0.588 * np.sin(0.7 * t)
    wrench = arm.weigh(q, dq, ddq)
    recording = LoadRecording(
        Trajectory(t, q, 0 * q), wrench + arm.noise * np.random.default_rng(2).normal(size=wrench.shape)
    )
    alone = identify_load(arm.body, "tool", [recording])
    assert alone.status == "too little motion"
    assert "turn the load faster" in " ".join(alone.all_warnings)
    assert alone.as_json()["principal_moments"]["value"] == [None, None, None]
    truth = rigid_load(arm.mass, arm.centre, arm.inertia)
    believed = RigidLoad(truth.parameters * 1.02, np.diag(np.abs(truth.parameters) * 0.05 + 1e-4) ** 2)
    with_prior = identify_load(arm.body, "tool", [recording], prior=believed)
    assert with_prior.status == "identified"
    spread = np.sqrt(np.diag(with_prior.load.covariance))
    assert np.all(spread <= np.sqrt(np.diag(believed.covariance)) * 1.001)
    assert np.all(np.abs(with_prior.load.parameters - truth.parameters) < 4.0 * spread)


def test_saturated_samples_are_left_out_and_told(loaded_puma: Any) -> None:
    arm = loaded_puma
    recording = arm.recording(8)
    limit = np.quantile(np.abs(recording.wrench), 0.98, axis=0)
    clipped = replace(recording, wrench=np.clip(recording.wrench, -limit, limit))
    found = identify_load(arm.body, "tool", [clipped], options=LoadOptions(sensor_range=limit))
    assert "at its limit" in found.warnings[0]
    assert found.samples < len(arm.t)
    assert abs(found.load.mass.value - arm.mass) < 4.0 * found.load.mass.standard_error
    blind = identify_load(arm.body, "tool", [clipped])
    assert abs(blind.load.mass.value - arm.mass) > abs(found.load.mass.value - arm.mass)
    pinned = replace(recording, wrench=np.full_like(recording.wrench, 10.0))
    with pytest.raises(InputError, match="at its limit throughout"):
        identify_load(arm.body, "tool", [pinned], options=LoadOptions(sensor_range=np.full(6, 10.0)))


def test_a_slower_sensor_is_brought_to_the_times_of_the_motion(loaded_puma: Any) -> None:
    arm = loaded_puma
    motion = Trajectory(arm.t, arm.q, 0 * arm.q)
    times = np.arange(0.013, 9.0, 1 / 87.0)
    times = times[(times < 3.0) | (times > 3.4)]
    wrench = CubicSpline(arm.t, arm.wrench)(np.minimum(times, arm.t[-1]))
    wrench[10] = np.nan
    aligned = align_wrench(motion, times, wrench)
    gap = (arm.t > 3.01) & (arm.t < 3.39)
    assert np.isnan(aligned.wrench[gap]).all()
    assert np.isnan(aligned.wrench[arm.t < 0.012]).all()
    good = np.isfinite(aligned.wrench).all(axis=1)
    assert np.mean(good) > 0.9
    np.testing.assert_allclose(aligned.wrench[good], arm.wrench[good], atol=0.05)
    with pytest.raises(InputError, match="does not rise"):
        align_wrench(motion, times[::-1], wrench)
    with pytest.raises(InputError, match="no channel"):
        LoadRecording(motion, np.full((len(arm.t), 6), np.nan))
