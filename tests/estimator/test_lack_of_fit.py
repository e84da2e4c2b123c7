"""Repeated motion tells whether the model lacks something; then no interval is promised."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimator import LinkOptions, RigidBody, Trajectory, identify_links, inverse_dynamics
from estimator.encoder_steps import encoder_steps

Array = NDArray[np.float64]
Motion = Callable[[int, float, float, int], tuple[Array, ...]]
VISCOUS = LinkOptions(terms=("viscous_friction",))


def repeated(
    dda: RigidBody, make_periodic: Motion, seed: int, hidden: float, colour: float = 0.0, playings: int = 3
) -> list[Trajectory]:
    """Playings of a motion with noise; ``hidden`` N·m of friction at joint 2 that grows with the load's angle."""
    t, q, dq, ddq = make_periodic(3, 8.0, 200.0, 5)
    random = np.random.default_rng(seed)
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq) + np.array([1.0, 0.5, 0.5]) * dq
    tau[:, 1] += hidden * np.sign(dq[:, 1]) * (1.0 + np.sin(3.0 * q[:, 1]))
    result = []
    for k in range(playings):
        noise = lfilter([np.sqrt(1.0 - colour**2)], [1.0, -colour], random.normal(size=tau.shape), axis=0)
        angle = q + 2e-5 * random.normal(size=q.shape)
        result.append(Trajectory(t, angle, tau + 0.5 * noise, dq + 1e-3 * random.normal(size=q.shape), name=f"run {k}"))
    return result


@pytest.mark.parametrize("colour", [0.0, 0.9])
def test_noise_alone_is_no_lack_of_fit(dda: RigidBody, make_periodic: Motion, colour: float) -> None:
    p_values = []
    for seed in range(25):
        found = identify_links(dda, repeated(dda, make_periodic, seed, 0.0, colour), VISCOUS)
        assert found.lack_of_fit is not None
        p_values += [test.p_value for test in found.lack_of_fit]
        assert found.lack_of_fit[0].playings == 3
    # 75 p-values that are evenly spread: a tenth of them below 0.1, give or take three standard deviations.
    assert 0.0 <= np.mean(np.array(p_values) < 0.1) <= 0.21
    assert np.mean(np.array(p_values) < 0.01) < 0.05
    assert 0.35 < np.median(p_values) < 0.75


def on_steps(recordings: list[Trajectory], counts: int) -> list[Trajectory]:
    step = 2.0 * np.pi / counts
    return [replace(r, q=np.round(r.q / step) * step) for r in recordings]


def test_steps_of_a_coarse_encoder_are_no_lack_of_fit(dda: RigidBody, make_periodic: Motion) -> None:
    """Playings that repeat to a hundredth of a step round alike."""
    fired = []
    for seed in range(8):
        coarse = on_steps(repeated(dda, make_periodic, seed, 0.0), 4096)
        found = identify_links(dda, coarse, VISCOUS)
        assert found.lack_of_fit is not None
        fired.append(found.withheld is not None)
    assert sum(fired) <= 1
    lacking = identify_links(dda, on_steps(repeated(dda, make_periodic, 1, 2.0), 4096), VISCOUS)
    assert lacking.withheld is not None
    assert "joint2" in lacking.withheld


def test_the_step_of_an_encoder_is_found(dda: RigidBody, make_periodic: Motion) -> None:
    fine = repeated(dda, make_periodic, 1, 0.0)
    np.testing.assert_array_equal(encoder_steps(fine), 0.0)
    np.testing.assert_allclose(encoder_steps(on_steps(fine, 4096)), 2.0 * np.pi / 4096, rtol=1e-6)
    # A second recording without steps: nothing is on steps throughout.
    np.testing.assert_array_equal(encoder_steps([*on_steps(fine[:1], 4096), fine[1]]), 0.0)


def test_hidden_friction_withholds_the_intervals(dda: RigidBody, make_periodic: Motion) -> None:
    found = identify_links(dda, repeated(dda, make_periodic, 1, 2.0), VISCOUS)
    assert found.lack_of_fit is not None
    assert found.lack_of_fit[1].p_value < 1e-6
    assert found.lack_of_fit[1].lacking_rms > 5.0 * found.lack_of_fit[1].noise_rms
    assert found.withheld is not None
    assert "joint2" in found.withheld
    assert "joint3" not in found.withheld
    assert np.isnan(found.interval()).all()
    answer = json.loads(json.dumps(found.as_json(), allow_nan=False))
    assert answer["intervals"] == {"withheld": found.withheld}
    assert answer["base_parameters"][0]["standard_error"] > 0.0
    assert answer["lack_of_fit"]["joint2"]["p_value"] < 1e-6


def test_pure_error_is_the_noise_whatever_the_model_lacks(dda: RigidBody, make_periodic: Motion) -> None:
    for hidden in (0.0, 2.0):
        found = identify_links(dda, repeated(dda, make_periodic, 2, hidden), VISCOUS)
        assert found.lack_of_fit is not None
        noise = 0.5 * np.sqrt(2.0 * found.band / 200.0)
        np.testing.assert_allclose([test.noise_rms for test in found.lack_of_fit], noise, rtol=0.2)


def test_without_repeats_the_intervals_say_so(dda: RigidBody, make_periodic: Motion) -> None:
    found = identify_links(dda, repeated(dda, make_periodic, 3, 0.0, playings=1), VISCOUS)
    assert found.lack_of_fit is None
    assert found.withheld is None
    intervals = found.as_json()["intervals"]
    assert "not tested" in intervals["caution"]
    assert len(intervals["base_parameters"]) == 15


def test_each_recording_is_predicted_from_the_others(dda: RigidBody, make_periodic: Motion) -> None:
    recordings = repeated(dda, make_periodic, 4, 0.0)
    fair = identify_links(dda, recordings, VISCOUS)
    assert set(fair.leave_one_out) == {"run 0", "run 1", "run 2"}
    assert all(error < 1.3 * fair.fit.relative_error for error in fair.leave_one_out.values())
    odd = replace(recordings[2], tau=1.1 * recordings[2].tau)
    unfair = identify_links(dda, [*recordings[:2], odd], VISCOUS)
    assert unfair.leave_one_out["run 2"] > 1.5 * unfair.leave_one_out["run 0"] > 0.0
    assert identify_links(dda, recordings[:1], VISCOUS).leave_one_out == {}


def test_impossible_signs_are_refused_and_said(dda: RigidBody, make_periodic: Motion) -> None:
    recordings = repeated(dda, make_periodic, 5, 0.0)
    driving = [replace(r, tau=r.tau - np.array([0.0, 0.0, 1.5]) * np.asarray(r.dq)) for r in recordings]
    found = identify_links(dda, driving, VISCOUS)
    assert {term.joint for term in found.terms} == {0, 1}
    assert any("viscous friction of joint3 would be -" in warning for warning in found.warnings)
    kept = identify_links(dda, driving, replace(VISCOUS, select_terms=False))
    assert kept.value[-1] == pytest.approx(-1.0, abs=0.05)
