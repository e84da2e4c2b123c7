"""The twin against closed forms: one joint under a servo, sticking, gaps in a recording, models it refuses."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from estimator.rigid_body import RigidBody, load_rigid_body
from estimator.trajectory import Trajectory
from estimator.twin.replay import replay
from estimator.twin.tracking import Tracking, estimated_servo, torque_replay, velocities

Array = NDArray[np.float64]

INERTIA = 0.5
URDF = f"""<robot name="wheel"><link name="base"/>
<joint name="axle" type="continuous"><parent link="base"/><child link="wheel"/><axis xyz="0 0 1"/></joint>
<link name="wheel"><inertial><mass value="1"/>
<inertia ixx="{INERTIA}" iyy="{INERTIA}" izz="{INERTIA}" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
STIFFNESS, DAMPING = 50.0, 4.0


@pytest.fixture(scope="module")
def wheel() -> RigidBody:
    return load_rigid_body(URDF)


def held_at(angle: float, start: float, duration: float = 2.0, rate: float = 500.0) -> tuple[Trajectory, Tracking]:
    """A servo that wants an angle; the wheel stands still elsewhere when the recording begins."""
    t = np.arange(0.0, duration, 1.0 / rate)
    still = np.zeros((len(t), 1))
    reference = np.full((len(t), 1), angle)
    gains = np.array([STIFFNESS]), np.array([DAMPING])
    recorded = Trajectory(t, np.full((len(t), 1), start), still, still)
    return recorded, Tracking("servo", reference, still, still, *gains)


def released(t: Array, inertia: float, damping: float) -> Array:
    """x(0) = 1, at rest, of inertia·x'' + damping·x' + K·x = 0."""
    w, decay = np.sqrt(STIFFNESS / inertia), damping / (2.0 * inertia)
    swing = np.sqrt(w**2 - decay**2)
    return np.asarray(np.exp(-decay * t) * (np.cos(swing * t) + decay / swing * np.sin(swing * t)))


@pytest.mark.parametrize(
    ("effects", "inertia", "damping"),
    [
        ((), INERTIA, DAMPING),
        ((FittedEffect("viscous_friction", Place(0), {"coefficient": 2.0}),), INERTIA, DAMPING + 2.0),
        ((FittedEffect("rotor_inertia", Place(0), {"inertia": 0.7}),), INERTIA + 0.7, DAMPING),
    ],
)
def test_a_wheel_under_a_servo_swings_as_in_the_book(
    effects: tuple[FittedEffect, ...], inertia: float, damping: float, wheel: RigidBody
) -> None:
    recorded, servo = held_at(0.0, 1.0)
    found = replay(ArmModel(wheel, effects), recorded, servo)
    np.testing.assert_allclose(found.q[:, 0], released(found.t, inertia, damping), atol=5e-4)
    np.testing.assert_allclose(found.tau, -STIFFNESS * found.q - DAMPING * found.dq, atol=1e-9)


def test_the_integrator_is_of_second_order(wheel: RigidBody) -> None:
    """Speeds are brought to the angles' time."""
    errors = []
    for rate in (2000.0, 4000.0):
        recorded, servo = held_at(0.0, 1.0, 1.0, rate)
        found = replay(ArmModel(wheel), recorded, servo)
        errors.append(np.abs(found.q[:, 0] - released(found.t, INERTIA, DAMPING)).max())
    assert errors[1] < 0.3 * errors[0] < 1e-5


def test_dry_friction_holds_what_the_servo_cannot_move(wheel: RigidBody) -> None:
    recorded, servo = held_at(0.1, 0.0)
    sticks = ArmModel(wheel, (FittedEffect("coulomb_friction", Place(0), {"level": 6.0}),))
    slips = ArmModel(wheel, (FittedEffect("coulomb_friction", Place(0), {"level": 4.0}),))
    assert np.abs(replay(sticks, recorded, servo).q).max() < 1e-4
    assert replay(slips, recorded, servo).q[-1, 0] == pytest.approx(0.02, abs=0.015)


def test_torque_replay_follows_the_recording_of_the_true_model(wheel: RigidBody) -> None:
    t = np.arange(0.0, 3.0, 0.004)
    q, dq, ddq = (x[:, None] for x in (np.sin(2.0 * t), 2.0 * np.cos(2.0 * t), -4.0 * np.sin(2.0 * t)))
    recorded = Trajectory(t, q, INERTIA * ddq, dq)
    found = replay(ArmModel(wheel), recorded, torque_replay(wheel, recorded, dq))
    assert found.position_error(recorded)[0] < 1e-4


def test_gains_are_estimated_from_commands_or_not_at_all(wheel: RigidBody) -> None:
    random = np.random.default_rng(1)
    t = np.arange(0.0, 3.0, 0.004)
    q, q_d = np.sin(2.0 * t)[:, None], np.sin(2.0 * t + 0.1)[:, None]
    dq, dq_d = np.gradient(q, t, axis=0), np.gradient(q_d, t, axis=0)
    tau = 30.0 * (q_d - q) + 5.0 * (dq_d - dq) + 1.0 + random.normal(0.0, 0.05, q.shape)
    servo = estimated_servo(Trajectory(t, q, tau, dq, q_desired=q_d), dq)
    assert servo is not None
    assert servo.stiffness[0] == pytest.approx(30.0, rel=0.02)
    assert servo.damping[0] == pytest.approx(5.0, rel=0.05)
    assert estimated_servo(Trajectory(t, q, tau + 20.0 * np.sin(9.0 * t)[:, None], dq, q_desired=q_d), dq) is None
    assert estimated_servo(Trajectory(t, q, tau, dq), dq) is None


def test_after_a_gap_the_replay_begins_from_what_was_measured(wheel: RigidBody) -> None:
    recorded, servo = held_at(0.0, 0.0)
    q = recorded.q.copy()
    q[500:520], q[520:] = np.nan, 0.3
    found = replay(ArmModel(wheel), Trajectory(recorded.t, q, recorded.tau, recorded.dq), servo)
    assert np.abs(found.q[:500]).max() < 1e-9
    assert np.isnan(found.q[500:520]).all()
    assert found.q[520, 0] == pytest.approx(0.3)


def test_a_motion_that_runs_away_is_an_input_error(wheel: RigidBody) -> None:
    recorded, servo = held_at(0.0, 1.0)
    wild = Tracking("wild", servo.q, servo.dq, servo.tau, -servo.stiffness * 1e6, -servo.damping * 1e6)
    with pytest.raises(InputError, match="runs away"):
        replay(ArmModel(wheel), recorded, wild)


def test_an_arm_without_masses_is_refused(wheel: RigidBody) -> None:
    recorded, servo = held_at(0.0, 1.0)
    with pytest.raises(InputError, match="joint axle moves has a mass"):
        replay(ArmModel(wheel.with_parameters(np.zeros(10))), recorded, servo)


def test_parameters_that_no_body_has_are_simulated_by_their_base_parameters(wheel: RigidBody) -> None:
    """Of a wheel on a vertical axis only Izz acts: a negative mass changes nothing."""
    impossible = wheel.prior()
    impossible[0], impossible[4] = -3.0, -1.0
    recorded, servo = held_at(0.0, 1.0)
    found = replay(ArmModel(wheel.with_parameters(impossible)), recorded, servo)
    np.testing.assert_allclose(found.q[:, 0], released(found.t, INERTIA, DAMPING), atol=5e-3)


def test_a_gap_s_neighbours_have_speeds_of_their_own() -> None:
    """Where none were measured."""
    t = np.arange(200) / 100.0
    q = np.column_stack([3.0 * t, -t])
    q[100:110] = np.nan
    q[110:] += 0.5
    speeds = velocities(Trajectory(t, q, np.zeros_like(q)))
    there = np.isfinite(q).all(axis=1)
    assert np.array_equal(np.isfinite(speeds).all(axis=1), there)
    np.testing.assert_allclose(speeds[there], np.tile([3.0, -1.0], (there.sum(), 1)), atol=1e-9)
