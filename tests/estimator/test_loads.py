"""Loads from wrenches: against Newton and Euler about the centre of mass, written out in the fixture."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from config import InputError
from estimator.delays import Delay
from estimator.loads import (
    LoadOptions,
    LoadRecording,
    RecursiveLoad,
    RigidLoad,
    identify_load,
    identify_static_load,
)
from estimator.loads.frame_motion import frame_motion
from estimator.loads.parameters import rigid_load
from estimator.loads.poses import Poses, resting_poses
from estimator.loads.wrench_regressor import wrench_regressor
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]
FORMS = ("differentiated", "integrated")


def test_regressor_is_newton_and_euler(loaded_puma: Any) -> None:
    arm = loaded_puma
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 30, 6))
    load = rigid_load(arm.mass, arm.centre, arm.inertia)
    predicted = wrench_regressor(frame_motion(arm.body, "tool", q, dq, ddq)) @ load.parameters
    np.testing.assert_allclose(predicted, arm.weigh(q, dq, ddq), atol=1e-12)
    np.testing.assert_allclose(load.inertia.value, arm.inertia, atol=1e-15)


@pytest.mark.parametrize("form", FORMS)
def test_recovery_without_noise(loaded_puma: Any, form: Any) -> None:
    arm = loaded_puma
    found = identify_load(arm.body, "tool", [arm.recording(noise=0.0)], options=LoadOptions(form=form))
    assert found.load.mass.value == pytest.approx(arm.mass, abs=6e-4)
    np.testing.assert_allclose(found.load.centre.value, arm.centre, atol=1e-4)
    np.testing.assert_allclose(found.load.inertia.value, arm.inertia, atol=2e-5)
    np.testing.assert_allclose(found.offset.value, arm.offset, atol=8e-3)
    assert abs(found.delay.value) < 1e-4


def test_the_forms_agree_and_neither_is_biased_by_noise_of_the_angles(loaded_puma: Any) -> None:
    arm = loaded_puma
    truth = rigid_load(arm.mass, arm.centre, arm.inertia).parameters
    pinned = Delay(0.0, 0.0)
    scores: dict[str, list[Array]] = {form: [] for form in FORMS}
    for seed in range(16):
        recording = arm.recording(seed, noise=0.3, angle_noise=1e-5)
        for form in FORMS:
            load = identify_load(arm.body, "tool", [recording], options=LoadOptions(form, delay=pinned)).load  # type: ignore[arg-type]
            scores[form].append((load.parameters - truth) / np.sqrt(np.diag(load.covariance)))
    for form in FORMS:
        mean = np.mean(scores[form], axis=0)
        assert np.abs(mean).max() < 1.0, form  # four standard errors of a mean of sixteen
    apart = np.array(scores["differentiated"]) - np.array(scores["integrated"])
    assert np.sqrt(np.mean(apart**2)) < 1.0


def test_intervals_cover(loaded_puma: Any) -> None:
    arm = loaded_puma
    hits: list[bool] = []
    for seed in range(60):
        found = identify_load(arm.body, "tool", [arm.recording(seed, angle_noise=1e-5)])
        load = found.load
        for quantity, truth in ((load.mass, arm.mass), (load.centre, arm.centre), (load.inertia, arm.inertia)):
            ends = found.interval(quantity)
            hits.extend(np.atleast_1d((ends[..., 0] <= truth) & (truth <= ends[..., 1])))
        hits.append(abs(found.delay.value) < 1.96 * found.delay.standard_error)
    assert 0.93 <= np.mean(hits) <= 0.97


def test_errors_of_a_short_motion_in_slow_noise_are_true(loaded_puma: Any) -> None:
    """The fit takes much of noise at the motion's own frequencies along: its errors must count that."""
    arm = loaded_puma
    truth = rigid_load(arm.mass, arm.centre, arm.inertia).parameters
    span, fades = slice(100, 700), float(np.exp(-2.0 * np.pi * 1.5 / 200.0))
    scores = []
    for seed in range(24):
        drive = np.random.default_rng(seed).normal(size=(900, 6)) * np.sqrt(1.0 - fades**2)
        slow = lfilter([1.0], [1.0, -fades], drive, axis=0)[300:]
        clean = arm.recording(seed, noise=0.1)
        motion = Trajectory(clean.motion.t[span], clean.motion.q[span], clean.motion.tau[span])
        recording = LoadRecording(motion, clean.wrench[span] + 0.5 * arm.noise * slow)
        load = identify_load(arm.body, "tool", [recording], options=LoadOptions(delay=Delay(0.0, 0.0))).load
        scores.append((load.parameters - truth) / np.sqrt(np.diag(load.covariance)))
    assert 0.8 < np.sqrt(np.mean(np.square(scores))) < 1.3


def at_rest(arm: Any, q: Array, seed: int, drift: float = 0.0) -> Poses:
    random, t = np.random.default_rng(seed), 5.0 * np.arange(len(q))
    wrench = arm.weigh(q, 0 * q, 0 * q) + arm.offset + drift * t[:, None]
    wrench += arm.noise / np.sqrt(1000) * random.normal(size=wrench.shape)
    return Poses(q, wrench, t, np.tile(arm.noise / np.sqrt(1000), (len(q), 1)))


def test_table_3_1_static(loaded_puma: Any) -> None:
    arm = loaded_puma
    q = np.random.default_rng(2).uniform(-2.0, 2.0, (6, 6))
    for drift in (0.0, 0.004):
        found = identify_static_load(arm.body, "tool", at_rest(arm, q, 3, drift), with_drift=drift > 0.0)
        assert abs(found.load.mass.value - arm.mass) < 0.010
        assert np.abs(found.load.centre.value - arm.centre).max() < 0.001
        assert np.isinf(found.load.inertia.standard_error).all()
        np.testing.assert_allclose(found.drift[:3], drift, atol=2e-3)
    with pytest.raises(InputError, match="gravity"):
        identify_static_load(arm.body, "tool", at_rest(arm, np.tile(q[:1], (6, 1)), 3))


def test_rests_are_found_and_averaged(loaded_puma: Any) -> None:
    arm = loaded_puma
    poses = resting_poses([arm.recording()])
    assert len(poses.q) == 2
    np.testing.assert_allclose(poses.q, 0.0, atol=2e-3)
    np.testing.assert_allclose(poses.wrench[0], arm.wrench[0] + arm.offset, atol=6 * arm.noise.max() / np.sqrt(100))
    moving = LoadRecording(Trajectory(arm.t[300:1500], arm.q[300:1500], 0 * arm.q[300:1500]), arm.wrench[300:1500])
    with pytest.raises(InputError, match="never rests"):
        resting_poses([moving])


def test_swinging_load_and_missing_channel(loaded_puma: Any) -> None:
    arm = loaded_puma
    assert identify_load(arm.body, "tool", [arm.recording(3)]).rigid.verdict == "rigid"
    found = identify_load(arm.body, "tool", [arm.recording(3, wrench=swinging(arm))])
    assert found.status == "not rigid"
    assert found.as_json()["mass"]["standard_error"] is None
    lacking = arm.recording(3)
    lacking.wrench[:, 2] = np.nan
    found = identify_load(arm.body, "tool", [lacking])
    assert "fz" in found.warnings[0]
    assert "fz" not in found.wrench_residual
    assert abs(found.load.mass.value - arm.mass) < 0.04


def swinging(arm: Any) -> Array:
    """The wrench of a load that swings at 4 Hz, hardly damped, on what carries it."""
    from scipy.signal import lfilter

    w, h = 2 * np.pi * 4.0, 1.0 / 200.0
    pole = np.exp((-0.05 + 1j) * w * h)
    poles = [1.0, -2.0 * pole.real, abs(pole) ** 2]
    start = arm.wrench[0]
    return np.asarray(lfilter([sum(poles)], poles, arm.wrench - start, axis=0) + start)


def test_recursive_follows_load_and_drift(loaded_puma: Any) -> None:
    arm = loaded_puma
    dq = np.gradient(arm.q, arm.t, axis=0)
    rows = wrench_regressor(frame_motion(arm.body, "tool", arm.q, dq, np.gradient(dq, arm.t, axis=0)))
    creep = np.outer(arm.t, [0.05, 0.0, -0.03, 0.0, 0.0, 0.0])
    walk = np.array([0.02] * 3 + [1e-3] * 3)
    live = RecursiveLoad(RigidLoad(np.zeros(10), np.eye(10)), arm.noise, offset_error=np.full(6, 10.0), drift=walk)
    random, surprises, errors = np.random.default_rng(4), [], []
    for a, w in zip(rows, arm.wrench + arm.offset + creep, strict=True):
        seen = w + arm.noise * random.normal(size=6)
        seen[2] = np.nan if random.random() < 0.05 else seen[2]
        surprises.append(live.update(a, seen, period=0.005))
        errors.append(float(live.load.mass.standard_error))
    assert abs(live.load.mass.value - arm.mass) < 4.0 * errors[-1]
    assert errors[-1] < 0.02
    assert errors == sorted(errors, reverse=True)
    assert 0.9 < np.nanstd(surprises) < 1.1
    with pytest.raises(InputError, match="positive"):
        RecursiveLoad(RigidLoad(np.zeros(10), np.eye(10)), np.zeros(6))
    with pytest.raises(InputError, match="all ten"):
        RecursiveLoad(RigidLoad(np.full(10, np.nan), np.eye(10)), arm.noise)
