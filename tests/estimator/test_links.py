"""Identified links against a known truth."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import LinkOptions, RigidBody, Trajectory, identify_links, inverse_dynamics
from estimator.prediction import model_torque_history, torque_history

Array = NDArray[np.float64]
Recordings = Callable[..., list[Trajectory]]

FRICTION = {"viscous": (0.5, 0.2, 0.1), "coulomb": (2.0, 1.0, 0.8)}


@pytest.mark.parametrize("estimator", ["least_squares", "weighted", "whitened", "instrumental_variables"])
def test_clean_recordings_give_the_truth(dda: RigidBody, measured_dda: Recordings, estimator: str) -> None:
    found = identify_links(dda, measured_dda(), LinkOptions(estimator=estimator, terms=()))
    truth = found.base.combination @ dda.prior()
    np.testing.assert_allclose(found.beta, truth, atol=1e-4 * np.abs(truth).max())
    assert found.status == "identified"
    assert found.fit.relative_error < 0.01


@pytest.mark.parametrize("estimator", ["least_squares", "weighted", "whitened", "instrumental_variables"])
def test_noisy_recordings_give_the_truth_within_their_errors(
    dda: RigidBody, measured_dda: Recordings, estimator: str
) -> None:
    recordings = measured_dda(1, torque_noise=0.5, velocity_noise=5e-4, **FRICTION)
    found = identify_links(dda, recordings, LinkOptions(estimator=estimator))
    deviation = (found.beta - found.base.combination @ dda.prior()) / found.standard_error[:15]
    assert np.abs(deviation).max() < 5.0
    assert np.sqrt(np.mean(deviation**2)) < 2.0


def test_friction_is_named_with_its_values(dda: RigidBody, measured_dda: Recordings) -> None:
    found = identify_links(dda, measured_dda(2, torque_noise=0.2, **FRICTION)).as_json()
    values = {(x["effect"], x["joint"]): x for x in found["effects"]}
    for k in range(3):
        for effect, truth in (
            ("viscous_friction", FRICTION["viscous"][k]),
            ("coulomb_friction", FRICTION["coulomb"][k]),
        ):
            entry = values[effect, f"joint{k + 1}"]
            assert abs(entry["value"] - truth) < 5.0 * entry["standard_error"] + 0.02 * truth


def test_nothing_is_fitted_that_the_data_do_not_support(dda: RigidBody, measured_dda: Recordings) -> None:
    wrong = [len(identify_links(dda, measured_dda(seed, torque_noise=0.5)).terms) for seed in range(5)]
    # Eleven candidates a recording; a bound of log(rows) on t² lets a percent or two of them through.
    assert sum(wrong) <= 4


def test_rotor_inertia_is_told_from_the_links(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, ...]]
) -> None:
    body = make_chain("rrrr", aligned=False)
    recordings = []
    for seed in (1, 2):
        t, q, dq, ddq = make_periodic(4, 10.0, 250.0, seed)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + np.array([0.0, 0.0, 0.9, 0.4]) * ddq
        tau += 0.2 * np.random.default_rng(seed).normal(size=tau.shape)
        recordings.append(Trajectory(t, q, tau, dq))
    found = identify_links(body, recordings)
    rotors = {t.joint: k for k, t in enumerate(found.terms, found.base.rank) if t.name == "rotor_inertia"}
    # The first joint's rotor is the same as its link's inertia about the axis, which takes it.
    assert set(rotors) == {2, 3}
    for joint, truth in ((2, 0.9), (3, 0.4)):
        assert abs(found.value[rotors[joint]] - truth) < 4.0 * found.standard_error[rotors[joint]]


def test_rotor_inertia_that_is_a_links_own_is_left_to_the_link(dda: RigidBody, measured_dda: Recordings) -> None:
    found = identify_links(dda, measured_dda(3, torque_noise=0.1, rotor=(0.7, 0.9, 0.0)))
    assert "rotor_inertia" not in {term.name for term in found.terms}
    shift = dict(zip(found.base.names, found.beta - found.base.combination @ dda.prior(), strict=True))
    assert shift["Izz2 + Ixx3"] == pytest.approx(0.9, abs=0.02)
    assert shift["Izz1 + Ixx2 + 0.2025 m3 + Ixx3"] == pytest.approx(0.7, abs=0.02)


def test_held_out_motion_is_judged_with_the_same_values(dda: RigidBody, measured_dda: Recordings) -> None:
    first, second, third = measured_dda(4, torque_noise=0.5, **FRICTION)
    found = identify_links(dda, [first, second, third], hold_out=[third])
    assert found.hold_out is not None
    assert set(found.hold_out.joints) == {"joint1", "joint2", "joint3"}
    for joint, residual in found.hold_out.joints.items():
        assert residual.rms < 2.5 * residual.noise_rms, joint
    spoilt = replace(third, tau=third.tau + np.array([0.0, 30.0, 0.0]) * np.sin(3.0 * third.t)[:, None])
    worse = identify_links(dda, [first, second, third], hold_out=[spoilt]).hold_out
    assert worse is not None
    assert worse.joints["joint2"].rms > 10.0 * found.hold_out.joints["joint2"].rms


def test_residual_of_white_noise_is_its_noise_figure(dda: RigidBody, measured_dda: Recordings) -> None:
    found = identify_links(dda, measured_dda(5, torque_noise=1.0), LinkOptions(terms=()))
    for residual in found.fit.joints.values():
        assert residual.noise_rms == pytest.approx(np.sqrt(found.band / 500.0), rel=0.1)
        assert residual.rms == pytest.approx(residual.noise_rms, rel=0.25)


def test_joint_at_rest_is_reported_not_fitted_over(dda: RigidBody) -> None:
    t = np.arange(6000) / 1000.0
    q = np.column_stack([np.full_like(t, 2.0), 1.0 + np.sin(2.1 * t), 1.0 + np.sin(3.3 * t)])
    dq = np.column_stack([np.zeros_like(t), 2.1 * np.cos(2.1 * t), 3.3 * np.cos(3.3 * t)])
    ddq = np.column_stack([np.zeros_like(t), -(2.1**2) * np.sin(2.1 * t), -(3.3**2) * np.sin(3.3 * t)])
    tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
    tau += 0.1 * np.random.default_rng(0).normal(size=tau.shape)
    found = identify_links(dda, [Trajectory(t, q, tau, dq)])
    assert found.status == "too little motion"
    missing = [x["name"] for x in found.as_json()["base_parameters"] if x["standard_error"] is None]
    assert "Izz1 + Ixx2 + 0.2025 m3 + Ixx3" in missing
    assert any("joint1" in warning for warning in found.warnings)


def test_lost_samples_are_left_out_and_told(dda: RigidBody, measured_dda: Recordings) -> None:
    recordings = measured_dda(6, torque_noise=0.3)
    tau = recordings[0].tau.copy()
    random = np.random.default_rng(9)
    tau[random.random(len(tau)) < 0.02, 1] = np.nan
    tau[900:960] = np.nan
    found = identify_links(dda, [replace(recordings[0], tau=tau), *recordings[1:]])
    deviation = (found.beta - found.base.combination @ dda.prior()) / found.standard_error[:15]
    assert np.abs(deviation).max() < 6.0
    assert "motion 1" in found.warnings[0]
    assert "1 gaps" in found.warnings[0]


def test_jittered_time_and_missing_velocity(dda: RigidBody, thesis_motions: list[tuple[Array, ...]]) -> None:
    random = np.random.default_rng(12)
    recordings = []
    for t, q, dq, ddq in thesis_motions:
        when = np.sort(t + random.uniform(-0.3e-3, 0.3e-3, len(t)))
        tau = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
        sample = [np.column_stack([np.interp(when, t, column) for column in x.T]) for x in (q, tau)]
        recordings.append(Trajectory(when, *sample))
    found = identify_links(dda, recordings, LinkOptions(terms=()))
    truth = found.base.combination @ dda.prior()
    np.testing.assert_allclose(found.beta, truth, atol=0.004 * np.abs(truth).max())


def test_order_of_recordings_does_not_matter(dda: RigidBody, measured_dda: Recordings) -> None:
    recordings = measured_dda(7, torque_noise=0.4, **FRICTION)
    forward, backward = identify_links(dda, recordings), identify_links(dda, recordings[::-1])
    np.testing.assert_allclose(forward.value, backward.value, rtol=1e-8, atol=1e-9)
    np.testing.assert_allclose(forward.standard_error, backward.standard_error, rtol=1e-6)


def test_answer_is_plain_json(dda: RigidBody, measured_dda: Recordings) -> None:
    recordings = measured_dda(8, torque_noise=0.4, **FRICTION)
    answer = json.loads(json.dumps(identify_links(dda, recordings, hold_out=recordings[:1]).as_json(), allow_nan=False))
    assert {
        "samples", "base_parameters", "identifiability", "torque_residual", "hold_out", "status", "condition_number",
    } <= set(answer)  # fmt: skip
    assert set(answer["base_parameters"][0]) == {"name", "value", "standard_error", "unit"}
    assert set(answer["torque_residual"]["joint1"]) == {"rms", "relative", "noise_rms", "unit", "in_motion"}
    assert set(answer["identifiability"]) == {"alone", "combined", "not"}


def test_full_parameters_keep_the_base_and_stay_near_the_prior(dda: RigidBody, measured_dda: Recordings) -> None:
    found = identify_links(dda, measured_dda(9, torque_noise=0.4))
    for prior in (None, dda.prior()):
        full = found.full_parameters(prior)
        np.testing.assert_allclose(found.base.combination @ full, found.beta, atol=1e-9)
    shift = found.full_parameters(dda.prior()) - dda.prior()
    assert np.linalg.norm(shift) < np.linalg.norm(found.full_parameters() - dda.prior())


def test_predicted_torque_follows_the_measured(dda: RigidBody, measured_dda: Recordings) -> None:
    recordings = measured_dda(10, torque_noise=0.2, **FRICTION)
    found = identify_links(dda, recordings)
    history = torque_history(found, recordings[1])
    assert history.t.shape == (len(history.measured),)
    assert history.relative_error < 0.6
    without_friction = model_torque_history(dda, dda.prior(), recordings[1], found.band)
    assert without_friction.relative_error > 1.5 * history.relative_error


def test_wrong_input_is_named(dda: RigidBody, measured_dda: Recordings) -> None:
    recording = measured_dda()[0]
    with pytest.raises(InputError, match="there are none"):
        identify_links(dda, [])
    with pytest.raises(InputError, match="has 2 joints, the arm has 3"):
        identify_links(
            dda, [replace(recording, q=recording.q[:, :2], tau=recording.tau[:, :2], dq=None, q_desired=None)]
        )
    with pytest.raises(InputError, match="no commanded motion"):
        identify_links(dda, [replace(recording, q_desired=None)], LinkOptions(estimator="instrumental_variables"))
    still = replace(recording, q=np.ones_like(recording.q), dq=None)
    with pytest.raises(InputError, match="no joint moves"):
        identify_links(dda, [still])
    short = Trajectory(recording.t[:40], recording.q[600:640], recording.tau[:40])
    with pytest.raises(InputError, match="too short"):
        identify_links(dda, [short])


def test_an_arm_of_meshes_alone_is_identified_and_its_body_has_the_torques(
    dda: RigidBody, measured_dda: Recordings
) -> None:
    """Of some links no torque tells the mass; their moments need one all the same."""
    recordings = measured_dda()
    bare = replace(dda, model=dda.model.copy())
    for inertia in bare.model.inertias:
        inertia.setZero()
    found = identify_links(bare, recordings, LinkOptions(terms=()))
    assert not bare.prior().any()
    for prior in (None, bare.prior()):
        body = found.identified_body(prior)
        for recording in recordings:
            q, dq = recording.q, recording.dq
            assert dq is not None
            ddq = np.gradient(dq, recording.t, axis=0)
            truth = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
            np.testing.assert_allclose(
                inverse_dynamics(body, body.prior(), q, dq, ddq), truth, atol=1e-3 * np.abs(truth).max()
            )
