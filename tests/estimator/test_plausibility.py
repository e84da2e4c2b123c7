"""Wrong input is named, each kind on a twin of known truth, and right input never is."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, identify_links, inverse_dynamics, load_rigid_body
from estimator.plausibility import Doubt, contradicting, cut_off, dead, examine, without_unusable_torques
from estimator.plausibility.snapshot import take
from estimator.standstill import rms_speeds

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]
DEGREES = 180.0 / np.pi


@pytest.fixture(scope="module")
def recording(six_axis: RigidBody, make_periodic: Periodic) -> Trajectory:
    """Six joints with friction and noise on every channel."""
    random = np.random.default_rng(11)
    t, q, dq, ddq = make_periodic(6, 20.0, 250.0, 3)
    tau = inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq)
    tau += 4.0 * np.tanh(dq / 0.02) + 3.0 * dq + 0.02 * np.abs(tau).max(axis=0) * random.normal(size=tau.shape)
    noise = 1e-4 * random.normal(size=(2, *q.shape))
    return Trajectory(t, q + noise[0], tau, dq + 10.0 * noise[1], name="motion")


def named(body: RigidBody, recording: Trajectory) -> Doubt:
    doubts = examine(body, [recording])
    assert len(doubts) == 1
    return doubts[0]


def columns(recording: Trajectory, order: list[int]) -> Trajectory:
    assert recording.dq is not None
    return replace(recording, q=recording.q[:, order], dq=recording.dq[:, order], tau=recording.tau[:, order])


def test_right_input_is_not_doubted(six_axis: RigidBody, recording: Trajectory) -> None:
    assert examine(six_axis, [recording]) == []
    assert examine(six_axis, [replace(recording, dq=None)]) == []
    usable, doubts = without_unusable_torques(six_axis, [recording])
    assert usable == [recording]
    assert doubts == []


def test_a_long_recording_of_one_joint_does_not_outweigh_short_ones_of_all(
    six_axis: RigidBody, make_periodic: Periodic
) -> None:
    """An experiment moves one joint for a quarter of a minute, beside motions of two seconds: what the others do shows
    in these alone. Looked at without them, the direct drive arm's own torques were said to be out of order."""

    def played(seconds: float, seed: int, moved: list[int]) -> Trajectory:
        t, *motion = make_periodic(6, seconds, 250.0, seed)
        q, dq, ddq = (0.15 * seconds / 20.0 * part for part in motion)
        held = np.isin(np.arange(6), moved, invert=True)
        q[:, held], dq[:, held], ddq[:, held] = q[0, held], 0.0, 0.0
        return Trajectory(t, q, inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq), dq)

    recordings = [*(played(2.1, seed, list(range(6))) for seed in (1, 2, 3)), *[played(15.0, 4, [5])] * 2]
    shot = take(recordings)
    assert shot is not None
    speeds = rms_speeds(recordings)
    assert (np.sqrt(np.mean(shot.dq**2, axis=0)) > 0.5 * speeds).all()
    assert examine(six_axis, recordings, believed=True) == []


def test_angles_in_degrees_beside_velocities_in_rad(six_axis: RigidBody, recording: Trajectory) -> None:
    small = replace(recording, q=0.02 * recording.q * DEGREES, dq=0.02 * np.asarray(recording.dq))
    for wrong in (replace(recording, q=recording.q * DEGREES), small):
        doubt = named(six_axis, wrong)
        assert doubt.kind == "angles in degrees"
        assert doubt.wrong
        assert "57" in doubt.problem


def test_velocities_in_degrees(six_axis: RigidBody, recording: Trajectory) -> None:
    doubt = named(six_axis, replace(recording, dq=np.asarray(recording.dq) * DEGREES))
    assert doubt.kind == "velocities in degrees"
    assert doubt.wrong


def test_everything_in_degrees(six_axis: RigidBody, recording: Trajectory) -> None:
    """Angles and velocities agree with each other then; speeds beyond the limits give it away, or the structure."""
    everything = replace(recording, q=recording.q * DEGREES, dq=np.asarray(recording.dq) * DEGREES)
    assert named(six_axis, everything).kind == "angles in degrees"
    unlimited = load_rigid_body(six_axis.urdf.replace("velocity='3'", "velocity='0'"))
    doubt = named(unlimited, replace(everything, dq=None))
    assert doubt.kind == "angles in degrees"
    assert "unexplained" in doubt.problem


@pytest.mark.parametrize("order", [[0, 2, 1, 3, 4, 5], [0, 1, 2, 5, 4, 3], [2, 0, 1, 3, 4, 5], [5, 4, 3, 2, 1, 0]])
def test_joints_out_of_order_are_named(six_axis: RigidBody, recording: Trajectory, order: list[int]) -> None:
    doubt = named(six_axis, columns(recording, order))
    assert doubt.kind == "joint order"
    assert doubt.wrong
    for place, joint in enumerate(order):
        told = f"j{place + 1} as j{joint + 1}" in doubt.problem
        assert told == (place != joint)


@pytest.mark.parametrize("order", [[1, 0, 2, 3, 4, 5], [0, 1, 4, 3, 2, 5]])
def test_channels_exchanged_by_themselves_are_named(
    six_axis: RigidBody, recording: Trajectory, order: list[int]
) -> None:
    doubt = named(six_axis, replace(recording, tau=recording.tau[:, order]))
    assert doubt.kind == "torque order"
    assert doubt.wrong
    turned = replace(recording, q=recording.q[:, order], dq=np.asarray(recording.dq)[:, order])
    assert named(six_axis, turned).kind == "angle order"


def test_torque_of_the_other_sign(six_axis: RigidBody, recording: Trajectory) -> None:
    doubt = named(six_axis, replace(recording, tau=-recording.tau))
    assert doubt.kind == "torque sign"
    (doubt,) = examine(six_axis, [replace(recording, tau=-recording.tau)], believed=True)
    assert (doubt.kind, doubt.joints) == ("torque sign", six_axis.joints), "of all, and not of what explains a little"
    one = recording.tau * np.array([1.0, 1.0, -1.0, 1.0, 1.0, 1.0])
    doubt = named(six_axis, replace(recording, tau=one))
    assert doubt.kind == "torque sign"
    assert doubt.joints == ("j3",)


def test_joint_turned_round(six_axis: RigidBody, recording: Trajectory) -> None:
    sign = np.array([1.0, -1.0, 1.0, 1.0, 1.0, 1.0])
    turned = replace(recording, q=recording.q * sign, dq=np.asarray(recording.dq) * sign, tau=recording.tau * sign)
    doubt = named(six_axis, turned)
    assert doubt.kind == "joint turned round"
    assert doubt.joints == ("j2",)


@pytest.mark.parametrize("scale", [1000.0, 0.02])
def test_torques_in_another_unit(six_axis: RigidBody, recording: Trajectory, scale: float) -> None:
    doubt = named(six_axis, replace(recording, tau=scale * recording.tau))
    assert doubt.kind == "torque scale"
    assert doubt.evidence == pytest.approx(scale, rel=0.1)
    assert doubt.wrong


def test_rough_masses_are_no_other_unit(six_axis: RigidBody, recording: Trajectory) -> None:
    """A URDF whose masses are off by a factor of three is what identification is for."""
    assert examine(six_axis, [replace(recording, tau=3.0 * recording.tau)]) == []


def test_load_on_the_wrist_is_no_other_unit(six_axis: RigidBody, make_periodic: Periodic) -> None:
    """Only the last joint moves, under a load ten times as heavy as its link."""
    random = np.random.default_rng(3)
    t, q, dq, ddq = make_periodic(6, 20.0, 250.0, 3)
    still = np.arange(6) < 5
    q[:, still], dq[:, still], ddq[:, still] = q[0, still], 0.0, 0.0
    loaded = six_axis.prior()
    loaded[50:] *= 10.0
    tau = inverse_dynamics(six_axis, loaded, q, dq, ddq) + 0.2 * random.normal(size=q.shape)
    assert examine(six_axis, [Trajectory(t, q, tau, dq)]) == []


@pytest.mark.parametrize(("joint", "strength"), [(4, 1.0), (4, 2.0), (4, 16.0), (5, 2.0), (5, 8.0), (5, 32.0)])
def test_a_strong_spring_is_no_other_reading(
    six_axis: RigidBody, make_periodic: Periodic, joint: int, strength: float
) -> None:
    """As strong as all else that the joint does, and more. Each was taken for a torque of the wrong sign, in kgf·m or
    kN·m, or for an angle in degrees: what a spring makes of a torque may look like another one."""
    for seed in (3, 4):
        random = np.random.default_rng(seed)
        t, q, dq, ddq = make_periodic(6, 20.0, 250.0, seed)
        tau = inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq)
        usual = tau.std(axis=0)
        tau += 0.01 * usual * random.normal(size=tau.shape)
        tau[:, joint] += strength * usual[joint] * (q[:, joint] - q[:, joint].mean()) / q[:, joint].std()
        assert examine(six_axis, [Trajectory(t, q, tau, dq)], believed=True) == []


@pytest.mark.parametrize("kind", ["spring", "friction", "wall"])
@pytest.mark.parametrize("strength", [1.0, 3.0])
def test_strong_effects_in_every_joint_are_no_other_arm(
    six_axis: RigidBody, make_periodic: Periodic, kind: str, strength: float
) -> None:
    """Most of the torques are not the links', and yet the links' are there."""
    t, q, dq, ddq = make_periodic(6, 20.0, 250.0, 3)
    tau = inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq)
    usual, turned = tau.std(axis=0), (q - q.mean(axis=0)) / q.std(axis=0)
    effects = {
        "spring": turned,
        "friction": np.tanh(dq / 0.01) * (1.0 + 0.4 * np.exp(-np.abs(dq) / 0.1)),
        "wall": np.maximum(turned - 0.5, 0.0),
    }
    noise = 0.01 * usual * np.random.default_rng(5).normal(size=tau.shape)
    assert (
        examine(six_axis, [Trajectory(t, q, tau + noise + strength * usual * effects[kind], dq)], believed=True) == []
    )


def test_urdf_of_another_arm(make_chain: Callable[..., RigidBody], recording: Trajectory) -> None:
    doubt = named(make_chain("rrrrrr", aligned=False), recording)
    assert doubt.kind == "another arm"
    assert "URDF" in doubt.remedy


def test_masses_are_not_needed(six_axis: RigidBody, recording: Trajectory) -> None:
    bare = load_rigid_body(six_axis.urdf.split("<inertial>")[0] + "".join(_without_inertials(six_axis.urdf)))
    assert examine(bare, [recording]) == []
    assert named(bare, columns(recording, [0, 2, 1, 3, 4, 5])).kind == "joint order"
    assert named(bare, replace(recording, tau=-recording.tau)).kind == "torque sign"


def _without_inertials(urdf: str) -> list[str]:
    return [part.split("</inertial>")[1] for part in urdf.split("<inertial>")[1:]]


def test_cut_off_torques_are_left_out(six_axis: RigidBody, recording: Trajectory) -> None:
    limit = 0.6 * float(np.abs(recording.tau[:, 1]).max())
    tau = recording.tau.copy()
    tau[:, 1] = np.clip(tau[:, 1], -limit, limit)
    (usable,), doubts = without_unusable_torques(six_axis, [replace(recording, tau=tau)])
    assert [doubt.kind for doubt in doubts] == ["torque cut off"]
    assert doubts[0].joints == ("j2",)
    assert usable.unusable is not None
    np.testing.assert_array_equal(usable.unusable[:, 1], np.abs(recording.tau[:, 1]) >= limit)
    assert not usable.unusable[:, [0, 2, 3, 4, 5]].any()
    truth = identify_links(six_axis, [recording])
    blind, told = (identify_links(six_axis, [x]) for x in (replace(recording, tau=tau), usable))
    error = [np.abs((x.beta - truth.beta) / truth.standard_error[: truth.base.rank]).max() for x in (blind, told)]
    assert error[1] < 5.0 < error[0]
    assert 0.3 < told.fit.joints["j2"].in_motion < 0.95


def test_quantised_and_resting_channels_are_not_cut_off() -> None:
    random = np.random.default_rng(6)
    t = np.linspace(0.0, 20.0, 5000)
    smooth = np.round(30.0 * np.sin(t)) / 30.0
    resting = np.round(np.where(t < 10.0, np.sin(t), np.sin(10.0)) + 0.01 * random.normal(size=len(t)), 2)
    settled = np.round(1.0 - np.exp(-t), 2)
    clipped = np.clip(np.round(2000.0 * np.sin(t)) / 2000.0, -0.8, 0.8)
    values = np.column_stack([smooth, resting, settled, clipped])
    assert cut_off(values).any(axis=0).tolist() == [False, False, False, True]
    assert not dead(values).any()
    assert dead(np.column_stack([np.full(50, 0.3), np.arange(50.0)])).tolist() == [True, False]


def test_dead_channel_is_left_out(six_axis: RigidBody, recording: Trajectory) -> None:
    tau = recording.tau.copy()
    tau[:, 0] = 0.0
    (usable,), doubts = without_unusable_torques(six_axis, [replace(recording, tau=tau)])
    assert [doubt.kind for doubt in doubts] == ["dead torque channel"]
    assert examine(six_axis, [usable]) == []
    found = identify_links(six_axis, [usable])
    assert found.fit.joints["j1"].in_motion == 0.0
    assert found.fit.joints["j2"].relative < 0.1


def test_slow_motions_say_nothing_of_the_torques_of_fast_ones(make_chain: Callable[..., RigidBody]) -> None:
    """Creeping motions, whose torque is gravity and friction, beside short fast ones: all of one arm. Fast ones tell of
    each other, whatever lies beside them."""
    body = make_chain("rrr")

    def swing(hertz: float, amplitude: tuple[float, ...], seconds: float, seed: int) -> Trajectory:
        random, t = np.random.default_rng(seed), np.arange(round(250.0 * seconds)) / 250.0
        w, a = 2.0 * np.pi * hertz * np.array([1.0, 1.3, 0.8]), np.array(amplitude)
        sine, cosine = np.sin(w * t[:, None]), np.cos(w * t[:, None])
        q, dq, ddq = 0.3 + a * sine, a * w * cosine, -a * w**2 * sine
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + 2.0 * np.sign(dq)
        return Trajectory(t, q, tau + 0.3 * random.normal(size=q.shape))

    for hertz in (1.0, 1.5):
        slow = [swing(0.05, (0.02, 0.1, 0.1), 24.0, seed) for seed in (0, 1)]
        fast = [swing(hertz, (0.8, 0.6, 0.8), 2.0, seed) for seed in (2, 3, 4)]
        for learnt, judged in ((slow, fast), (fast, slow), ([*slow, *fast], [*slow, *fast])):
            assert contradicting(body, learnt, judged) == {}
        wrong = [replace(fast[0], tau=-fast[0].tau), *fast[1:]]
        assert 2 in contradicting(body, [*slow, *wrong], [*slow, *wrong])
