"""Each law against an independent form of itself: the nonlinear inverse dynamics, closed forms, small steps in time."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray
from scipy.optimize import brentq
from scipy.spatial.transform import Rotation

from config import InputError
from estimator.effects import Place, Scales, Signals, effect
from estimator.effects.backlash import play
from estimator.effects.presliding import bristle
from estimator.effects.second_order import resonated, second_order_lag
from estimator.effects.waves import each_quadratures
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]
ELBOW = Place(2)


def torque(name: str, place: Place, signals: Signals, **parameters: float | Array) -> Array:
    return effect(name).torque(place, parameters, signals)


def rigid(body: RigidBody, q: Array, dq: Array, ddq: Array) -> Array:
    return inverse_dynamics(body, body.prior(), q, dq, ddq)


def assert_close(found: Array, expected: Array, share: float) -> None:
    """Within a share of the rms."""
    assert np.sqrt(np.mean((found - expected) ** 2)) < share * np.sqrt(np.mean(expected**2))


def test_an_offset_is_the_torque_at_the_other_angle(signals: Signals) -> None:
    s, shift = signals, np.eye(6)[2] * 1e-3
    expected = rigid(s.body, s.q + shift, s.dq, s.ddq) - s.tau_rigid
    assert_close(torque("encoder_offset", ELBOW, s, offset=1e-3), expected, 2e-3)


def test_an_eccentric_disc_is_the_torque_of_the_motion_that_was_not_measured(signals: Signals) -> None:
    """measured = true + a·sin(true + φ): given the true motion, the measured one follows in closed form."""
    s, joint, a, phase = signals, 2, 1e-3, 0.7
    x, v, w = s.q[:, joint], s.dq[:, joint], s.ddq[:, joint]
    wave, slope = np.sin(x + phase), np.cos(x + phase)
    true = [s.q.copy(), s.dq.copy(), s.ddq.copy()]
    for channel, error in zip(true, (wave, slope * v, slope * w - wave * v**2), strict=True):
        channel[:, joint] -= a * error
    found = torque("encoder_eccentricity", ELBOW, s, amplitude=a, phase=phase)
    assert_close(found[5:-5], (rigid(s.body, *true) - s.tau_rigid)[5:-5], 5e-3)


def test_an_eccentric_disc_has_not_the_speed_of_a_tachometer(signals: Signals) -> None:
    """The slope of what the disc reads is in error, the tachometer's speed is not; speeds of the same disc agree."""
    joint, a, phase = 2, 1e-3, 0.7
    found = effect("encoder_eccentricity")
    _, coefficients = found.unknowns(ELBOW, {"amplitude": a, "phase": phase})
    assert found.speed_rows(signals.body, ELBOW) == (joint,)
    slope_of_error = a * np.cos(signals.q[:, joint] + phase) * signals.dq[:, joint]
    own = found.speed_columns(ELBOW, signals, np.array([1.0, 0.0, 0.0]))[:, 0] @ coefficients
    assert_close(own[5:-5], -slope_of_error[5:-5], 5e-3)
    assert not found.speed_columns(ELBOW, signals, np.zeros(3)).any()


def test_a_disc_that_is_far_out_of_centre_is_told_by_its_true_angle(signals: Signals) -> None:
    """Of 0.1 rad, speed and torque at the true angle, to the error of two differences; those linear in the amplitude
    miss by a tenth."""
    joint, a, phase = 2, 0.1, 0.7
    found, measured = effect("encoder_eccentricity"), signals.q[:, 2]
    true = np.array([brentq(lambda x, m=m: x + a * np.sin(x + phase) - m, m - 0.2, m + 0.2) for m in measured])
    theta, coefficients = found.unknowns(ELBOW, {"amplitude": a, "phase": phase})
    speed = signals.dq[:, joint] / (1.0 + a * np.cos(true + phase))
    own = found.speed_columns(ELBOW, signals, theta)[:, 0] @ coefficients
    assert_close(own[5:-5], (speed - signals.dq[:, joint])[5:-5], 5e-3)
    moved = [signals.q.copy(), signals.dq.copy(), signals.ddq.copy()]
    moved[0][:, joint], moved[1][:, joint] = true, speed
    moved[2][:, joint] = signals.slope(speed)
    torque_there = rigid(signals.body, *moved) - signals.tau_rigid
    assert_close(
        torque("encoder_eccentricity", ELBOW, signals, amplitude=a, phase=phase)[5:-5], torque_there[5:-5], 5e-3
    )
    linear = found.columns(ELBOW, signals, np.array([1.0, 0.0, 0.0])) @ coefficients
    assert np.abs(linear - torque_there)[5:-5].max() > 0.05 * np.abs(torque_there)[5:-5].max()


def test_a_tilted_base_is_turned_gravity(signals: Signals) -> None:
    roll, pitch = 2e-3, -3e-3
    tilted = Rotation.from_euler("xy", [roll, pitch]).inv().apply(signals.body.gravity)
    body = replace(signals.body, gravity=np.asarray(tilted))
    expected = rigid(body, signals.q, signals.dq, signals.ddq) - signals.tau_rigid
    assert_close(torque("base_tilt", Place(), signals, roll=roll, pitch=pitch), expected, 5e-3)


def test_a_push_is_held_by_the_transposed_jacobian(signals: Signals) -> None:
    force = np.array([3.0, -5.0, 2.0])
    found = torque("contact", Place(), signals, where=np.array([1.0, 3.0]), force=force)
    body, data = signals.body, signals.body.model.createData()
    for sample in (300, 500):
        q = body.configuration(signals.q[sample])
        jacobian = pin.computeJointJacobians(body.model, data, q)
        jacobian = pin.getJointJacobian(body.model, data, body.n, pin.ReferenceFrame.LOCAL_WORLD_ALIGNED)
        np.testing.assert_allclose(found[sample], -jacobian[:3].T @ force, atol=1e-9)
    np.testing.assert_allclose(found[:100], 0.0, atol=1e-9)


def test_a_wall_pushes_back_where_the_arm_is_behind_it(signals: Signals) -> None:
    normal = np.array([0.6, 0.0, -0.8])
    along = signals.tip @ normal
    place = 0.5 * (along.min() + along.max())
    found = torque("contact", Place(), signals, where=place * normal, force=-300.0 * normal)
    body, data = signals.body, signals.body.model.createData()
    behind = [int(np.argmax(along)), *np.flatnonzero(along > place)[::50]]
    for sample in (int(np.argmin(along)), *behind):
        pin.forwardKinematics(body.model, data, body.configuration(signals.q[sample]))
        np.testing.assert_allclose(signals.tip[sample], data.oMi[body.n].translation, atol=1e-12)
        depth = max(float(normal @ data.oMi[body.n].translation) - place, 0.0)
        pushed = torque("contact", Place(), signals, where=np.array([-9.0, 9e9]), force=-300.0 * depth * normal)
        np.testing.assert_allclose(found[sample], pushed[sample], atol=1e-9)
    assert not np.any(found[int(np.argmin(along))])
    assert np.any(found[behind[0]])


def test_walls_lean_no_way_that_the_tool_does_not_move(signals: Signals) -> None:
    """What lies across the plane that the tool moves in would change no torque."""
    whole = Scales.of([signals], 10.0)
    flat = replace(whole, tip=whole.tip * [1.0, 0.0, 1.0] + [0.0, 0.3, 0.0])
    still = replace(whole, tip=np.ones_like(whole.tip))
    grids = [effect("contact").grid(Place(), scales) for scales in (whole, flat, still)]
    everywhere, upright, nowhere = ([one[1:4] for one in grid if one[0] == 1.0] for grid in grids)
    assert np.any(np.array(everywhere)[:, 1])
    assert 0 < len(upright) < len(everywhere)
    assert not np.any(np.array(upright)[:, 1])
    np.testing.assert_allclose(np.linalg.norm(upright, axis=1), 1.0)
    assert not nowhere


def test_walls_about_a_wall_are_near_it_and_none_is_met_always(signals: Signals) -> None:
    contact = effect("contact")
    place, scales = Place(), Scales.of([signals], 20.0)
    normal = np.array([0.6, 0.0, 0.8])
    along = signals.tip @ normal
    for share in (1.0, 0.25):
        deep = along.max() - 0.55 * np.ptp(along)
        around = contact.around(place, scales, np.array([1.0, *normal, deep]), share)
        assert len(np.unique(around.round(9), axis=0)) > 6
        np.testing.assert_allclose(np.linalg.norm(around[:, 1:4], axis=1), 1.0)
        assert np.arccos(np.clip(around[:, 1:4] @ normal, -1.0, 1.0)).max() < 0.41 * share
        for wall in around:
            there = scales.tip @ wall[1:4]
            assert 0.0 < there.max() - wall[4] <= 0.6 * np.ptp(there) + 1e-12
    assert not len(contact.around(place, scales, contact.grid(place, scales)[0], 1.0)), "a push at a time is no wall"


def test_a_payload_is_a_body_at_the_flange(signals: Signals) -> None:
    mass, centre = 0.8, np.array([0.02, -0.01, 0.05])
    heavier = signals.body.prior()
    about = mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
    heavier[-10:] += [mass, *(mass * centre), *about[np.triu_indices(3)]]
    expected = inverse_dynamics(signals.body, heavier, signals.q, signals.dq, signals.ddq) - signals.tau_rigid
    np.testing.assert_allclose(torque("payload", Place(), signals, mass=mass, centre=centre), expected, atol=1e-9)
    own = np.array([2e-3, 1e-4, 0.0, 3e-3, -2e-4, 2.5e-3])
    heavier[-6:] += own
    expected = inverse_dynamics(signals.body, heavier, signals.q, signals.dq, signals.ddq) - signals.tau_rigid
    bulky = torque("payload", Place(), signals, mass=mass, centre=centre, inertia=own)
    np.testing.assert_allclose(bulky, expected, atol=1e-9)


def test_a_late_torque_is_that_of_the_time_before(
    arm: RigidBody, motion: Motion, signals_of: Callable[[Motion], Signals]
) -> None:
    """Ten samples late: no interpolation, no first order."""
    signals = signals_of(motion)
    by = 10.0 * signals.period
    late = torque("transport_delay", Place(channel="torque"), signals, delay=by)
    np.testing.assert_allclose((signals.tau_rigid + late)[10:], signals.tau_rigid[:-10], atol=1e-9)
    own = torque("transport_delay", Place(1, channel="torque"), signals, delay=by)
    np.testing.assert_array_equal(own, late * np.eye(late.shape[1])[1])
    early = torque("transport_delay", Place(channel="position"), signals, delay=by)
    np.testing.assert_allclose((signals.tau_rigid + early)[:-10], signals.tau_rigid[10:], atol=1e-9)


def test_a_weaker_motor_is_measured_stronger(signals: Signals) -> None:
    found = torque("torque_constant_error", ELBOW, signals, gain=0.8)
    np.testing.assert_allclose(0.8 * (signals.tau_rigid + found)[:, 2], signals.tau_rigid[:, 2], atol=1e-9)


def test_saturation_and_dead_zone_undo_their_curves(signals: Signals) -> None:
    true = signals.tau_rigid[:, 2]
    limit = 1.1 * float(np.abs(true).max())
    measured = true + torque("torque_nonlinearity", ELBOW, signals, limit=limit)[:, 2]
    np.testing.assert_allclose(limit * np.tanh(measured / limit), true, atol=1e-9 * limit)
    measured = true + torque("torque_nonlinearity", ELBOW, signals, dead_zone=0.5)[:, 2]
    returned = np.copysign(np.maximum(np.abs(measured) - 0.5, 0.0), measured)
    away = np.abs(true) > 0.5
    np.testing.assert_allclose(returned[away], true[away], atol=0.02)


def test_a_motor_that_ripples_is_measured_as_what_it_spends(signals: Signals) -> None:
    true, angle = signals.tau_rigid[:, 2], signals.q[:, 2]
    measured = true + torque("torque_ripple", ELBOW, signals, order=6.0, amplitude=0.3, phase=0.4)[:, 2]
    np.testing.assert_allclose(measured * (1.0 - 0.3 * np.sin(6.0 * angle + 0.4)), true, atol=1e-9)


def test_dahl_s_bristle_is_its_differential_equation() -> None:
    t = np.linspace(0.0, 6.0, 601)
    q = 0.01 * np.sin(t) + 0.004 * np.sin(3.1 * t)
    distance, fine, f = 2e-3, 200, 0.0
    expected = np.zeros(len(q))
    for k in range(1, len(q)):
        step = (q[k] - q[k - 1]) / fine
        for _ in range(fine):
            f += (1.0 - f * np.sign(step)) * step / distance
        expected[k] = f
    np.testing.assert_allclose(bristle(q, distance), expected, atol=2e-2)
    assert np.array_equal(bristle(np.zeros(10), distance), np.zeros(10))


def test_friction_s_sign_has_the_asked_levels(signals: Signals) -> None:
    s = signals
    fast = np.abs(s.dq[:, 2]) > 0.2
    found = torque(
        "asymmetric_friction", ELBOW, s,
        level_positive=2.0, level_negative=1.0, coefficient_positive=0.5, coefficient_negative=0.3,
    )[fast, 2]  # fmt: skip
    speed = s.dq[fast, 2]
    np.testing.assert_allclose(found, np.where(speed > 0.0, 2.0 + 0.5 * speed, -1.0 + 0.3 * speed), atol=1e-9)
    found = torque("stribeck_friction", ELBOW, s, level=1.0, breakaway=3.0, velocity=0.3, coefficient=0.2)[fast, 2]
    expected = (1.0 + 2.0 * np.exp(-((speed / 0.3) ** 2))) * np.sign(speed) + 0.2 * speed
    np.testing.assert_allclose(found, expected, atol=1e-6)


def test_drift_begins_and_ends_where_it_says(signals: Signals) -> None:
    found = torque("friction_drift", ELBOW, signals, initial=3.0, final=1.0, time_constant=0.5)[:, 2]
    level = found / np.sign(signals.dq[:, 2])
    moving = np.abs(signals.dq[:, 2]) > 0.2
    np.testing.assert_allclose(level[moving], 1.0 + 2.0 * np.exp(-signals.t[moving] / 0.5), atol=1e-6)


def test_grease_that_warms_is_thinner(signals: Signals) -> None:
    law, dq = effect("friction_drift").of(["initial_coefficient"]), signals.dq[:, 2]
    by_time = {"initial_coefficient": 3.0, "final_coefficient": 1.0, "time_constant": 0.5}
    np.testing.assert_allclose(
        law.torque(ELBOW, by_time, signals)[:, 2], (1.0 + 2.0 * np.exp(-signals.t / 0.5)) * dq, atol=1e-9
    )
    ends = {"initial_coefficient": 3.0, "final_coefficient": 1.0, "initial_temperature": 20.0}
    warming = np.repeat(20.0 + 4.0 * signals.t[:, None], signals.body.n, axis=1)
    found = law.torque(ELBOW, ends | {"final_temperature": 40.0}, replace(signals, temperature=warming))[:, 2]
    np.testing.assert_allclose(found, (3.0 - 0.1 * (warming[:, 2] - 20.0)) * dq, atol=1e-9)


@pytest.mark.parametrize("frequency", [2.0, 9.0, 40.0])
def test_a_lag_answers_a_sine_as_its_transfer_function(frequency: float) -> None:
    period, resonance, ratio = 1e-3, 10.0, 0.1
    t = np.arange(0.0, 6.0, period)
    found = resonated(np.sin(2.0 * np.pi * frequency * t), period, resonance, ratio)
    u = frequency / resonance
    answer = 1.0 / (1.0 - u**2 + 2.0j * ratio * u)
    expected = np.imag(answer * np.exp(2.0j * np.pi * frequency * t))
    settled = t > 3.0
    np.testing.assert_allclose(found[settled], expected[settled], atol=0.03 * abs(answer) + 1e-3)


def test_a_lag_leaves_what_stands_still() -> None:
    np.testing.assert_allclose(second_order_lag(np.full(50, 3.0), 0.01, 0.02, 0.01), 3.0)


@pytest.mark.parametrize(("relaxation", "square"), [(0.02, 0.01), (0.02, 0.0), (0.01, 5e-5), (1e-4, 1e-8), (1e-5, 0)])
def test_a_lag_of_any_speed_answers_what_a_coarse_grid_shows(relaxation: float, square: float) -> None:
    """A sine of thirteen samples, as of 6.4 Hz in 12 ms: to a thousandth, where straight lines are off by two percent.
    At the last of them nothing says how it bends."""
    period, w = 0.012, 40.0
    t = period * np.arange(4000)
    found = second_order_lag(np.sin(w * t), period, relaxation, square)
    answer = 1.0 / (1.0 - square * w**2 + 1.0j * relaxation * w)
    settled = t > 20.0 * max(relaxation, 2.0 * square / relaxation)
    error = (found - np.imag(answer * np.exp(1.0j * w * t)))[settled][:-1]
    assert np.max(np.abs(error)) < 1.5e-3 * abs(answer)


def test_an_elastic_joint_gives_by_its_torque_over_its_stiffness(signals: Signals) -> None:
    """Far below the resonance the link hangs behind the motor by tau/k."""
    stiffness, s = 1e5, signals
    lag = s.tau_rigid[:, 2] / stiffness
    behind = [channel.copy() for channel in (s.q, s.dq, s.ddq)]
    for channel in behind:
        channel[:, 2] -= lag
        lag = np.gradient(lag, s.period)
    found = torque("joint_elasticity", ELBOW, s, stiffness=stiffness, damping=0.0)
    assert_close(found[20:-20], (rigid(s.body, *behind) - s.tau_rigid)[20:-20], 0.05)


def test_a_gap_is_crossed_in_free_flight() -> None:
    """With acceleration a·t after the turn, half a gap to either side: gap = a·t³/6."""
    period, slope, gap = 1e-4, 50.0, 0.01
    t = np.arange(-0.5, 0.5, period)
    ahead = play(slope * t, period, gap)
    assert ahead[0] == -gap / 2.0
    assert ahead[-1] == gap / 2.0
    arrival = t[np.flatnonzero(ahead == gap / 2.0)[0]]
    assert arrival == pytest.approx((6.0 * gap / slope) ** (1.0 / 3.0), rel=0.01)


def test_wrench_effects_are_what_the_sensor_says(signals: Signals) -> None:
    place, wrench = Place(channel="wrench"), signals.load_wrench
    assert wrench is not None

    def added(name: str, **parameters: Array) -> Array:
        theta, coefficients = effect(name).unknowns(place, parameters)
        return np.asarray(effect(name).columns(place, signals, theta) @ coefficients)

    bias = np.arange(6.0)
    np.testing.assert_allclose(added("wrench_bias", bias=bias), np.tile(bias, (signals.samples, 1)))
    np.testing.assert_allclose(added("wrench_drift", rate=bias), signals.t[:, None] * bias)
    matrix = np.eye(6) + 0.1 * np.random.default_rng(0).normal(size=(6, 6))
    np.testing.assert_allclose(wrench + added("wrench_gain", matrix=matrix.ravel()), wrench @ matrix.T)
    turn = np.array([1e-3, -2e-3, 1.5e-3])
    inverse = Rotation.from_rotvec(turn).inv()
    turned = np.hstack([inverse.apply(wrench[:, :3]), inverse.apply(wrench[:, 3:])])
    np.testing.assert_allclose(wrench + added("wrench_misalignment", rotation=turn), turned, atol=1e-4)
    with pytest.raises(InputError, match="no load"):
        effect("wrench_gain").columns(place, replace(signals, load_wrench=None), np.zeros(0))


@pytest.mark.parametrize("orders", [(7.0,), (1.0, 2.5, 4.0, 5.5), (1.0, 2.5, 3.9, 7.0), (36.0, 12.0)])
def test_waves_of_many_orders_are_those_of_each(signals: Signals, orders: tuple[float, ...]) -> None:
    angle = signals.q[:, 1]
    made = list(each_quadratures(orders, angle, signals.dq[:, 1] * signals.period))
    assert len(made) == len(orders)
    for order, waves in zip(orders, made, strict=True):
        np.testing.assert_allclose(waves, np.stack([np.sin(order * angle), np.cos(order * angle)], axis=1), atol=1e-12)


def test_a_wave_that_passes_faster_than_samples_tell_is_none() -> None:
    """Left in, one that goes on by 0.99 of a period a sample would be a slow one of its own."""
    turned = np.full(400, 0.99 * 2.0 * np.pi / 80.0)
    (fast,), (slow,) = (each_quadratures([order], np.cumsum(turned), turned) for order in (80.0, 8.0))
    assert not np.any(fast)
    np.testing.assert_allclose(np.hypot(*slow.T), 1.0)
