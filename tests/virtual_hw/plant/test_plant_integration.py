"""The plant without hidden effects is a rigid body: against Pinocchio, an adaptive integrator, and energy."""

from __future__ import annotations

import math

import numpy as np
import pinocchio as pin
import pytest
from scipy.integrate import solve_ivp

from config import Installation, load_installation
from virtual_hw.hidden import parse_hidden
from virtual_hw.plant import build_plant

FREE, HELD = [False], [True]
LINEAR = math.sqrt(2 * 9.81 * 0.5 / 0.6)


def test_starts_at_rest_at_home_and_the_brake_holds(make_pendulum):
    plant = make_pendulum(home=0.7)
    for _ in range(200):
        plant.advance([0.0], HELD)
    q, dq = plant.true_state()
    assert q[0] == pytest.approx(0.7, abs=1e-9)
    assert dq[0] == pytest.approx(0.0, abs=1e-9)
    assert plant.time_ns == 200 * plant.tick_ns


def test_released_pendulum_falls_with_the_acceleration_of_its_inertia(make_pendulum):
    plant = make_pendulum()
    plant.advance([0.0], FREE)
    # Gravity turns the rod, stretched along x, about +y: m·g·c / I.
    assert plant.true_state()[1][0] == pytest.approx(2.0 * 9.81 * 0.5 / 0.6 * 1e-3, rel=1e-5)


def test_swing_keeps_its_energy(make_pendulum):
    plant = make_pendulum()
    energies = []
    for _ in range(5000):
        plant.advance([0.0], FREE)
        (q,), (dq,) = plant.true_state()
        energies.append(0.3 * dq * dq - 9.81 * math.sin(q))
    assert np.ptp(energies) < 2e-5 * 9.81


@pytest.mark.parametrize("tick_us", [500, 1000])
def test_error_falls_with_the_square_of_the_step(make_pendulum, tick_us):
    reference = solve_ivp(
        lambda t, x: [x[1], LINEAR**2 * math.cos(x[0])], (0.0, 2.0), [0.0, 0.0], rtol=1e-12, atol=1e-13
    ).y[:, -1]
    errors = []
    for substeps in (1, 2):
        plant = make_pendulum(f"tick_us = {tick_us}\nsubsteps = {substeps}")
        for _ in range(2_000_000 // tick_us):
            plant.advance([0.0], FREE)
        errors.append(abs(plant.true_state()[1][0] - reference[1]))
    assert errors[0] / errors[1] == pytest.approx(4.0, rel=0.1)
    assert errors[0] < 1e-6


def test_angle_and_speed_are_of_one_instant(make_pendulum):
    """A step that pairs new speed with an angle half a step ahead would show as a delay of 0.5 ms."""
    plant = make_pendulum()
    states = []
    for _ in range(3000):
        plant.advance([0.0], FREE)
        states.append([x[0] for x in plant.true_state()])
    q, dq = np.array(states).T
    central = (q[2:] - q[:-2]) / (2e-3)
    accelerations = np.gradient(dq, 1e-3)[1:-1]
    delay = float(accelerations @ (central - dq[1:-1]) / (accelerations @ accelerations))
    assert abs(delay) < 1e-5


@pytest.fixture(scope="module")
def dda() -> Installation:
    return load_installation("dda")


def _pinocchio(installation: Installation) -> pin.Model:
    """The URDF's model with bodies that two independent libraries read alike."""
    return pin.buildModelFromUrdf(str(installation.path.parent / installation.arm.urdf))


def test_torques_that_pinocchio_computes_hold_the_arm_still(dda):
    model = _pinocchio(dda)
    # A current loop without lag: no impulse is missing while the torque rises.
    motors = "".join(f'[[motor]]\njoint = "{name}"\nbandwidth_hz = 1e7\n' for name in dda.joint_names)
    plant = build_plant(dda, parse_hidden(motors, dda), 1)
    gravity = pin.computeGeneralizedGravity(model, model.createData(), np.array(dda.arm.home_rad))
    for _ in range(50):
        plant.advance(gravity.tolist(), [False] * 3)
    assert np.abs(plant.true_state()[1]).max() < 1e-6


def test_arm_in_motion_accelerates_as_pinocchio_computes(dda):
    model = _pinocchio(dda)
    data = model.createData()
    plant = build_plant(dda, parse_hidden("tick_us = 250", dda), 1)
    rng = np.random.default_rng(5)
    tau = rng.uniform(-30, 30, 3) * [3, 1, 0.3]
    states = []
    for _ in range(1200):
        plant.advance(tau.tolist(), [False] * 3)
        states.append(plant.true_state())
    q, dq = np.array(states).transpose(1, 0, 2)
    assert np.abs(dq[-1]).max() > 1.0
    measured = (dq[2:] - dq[:-2]) / (2 * 250e-6)
    # After the current loop has risen.
    for k in range(100, 1190, 109):
        expected = pin.aba(model, data, q[k], dq[k], tau)
        np.testing.assert_allclose(measured[k - 1], expected, atol=2e-3 * np.abs(expected).max())


def test_same_seed_same_plant_other_seed_other_noise(dda):
    def run(seed: int) -> list[tuple[int, float, float, tuple[float, float, float]]]:
        plant = build_plant(dda, None, seed)
        rows = []
        for k in range(300):
            plant.advance([5.0 * math.sin(0.05 * k), 1.0, -0.5], [k < 10] * 3)
            rows += [(plant.counts(i), plant.velocity(i), plant.torque(i), plant.currents(i)) for i in range(3)]
        return rows

    first = run(7)
    assert run(7) == first
    assert run(8) != first


def test_built_twice_side_by_side_they_do_not_disturb_each_other(dda):
    alone, first, second = (build_plant(dda, None, 3) for _ in range(3))
    for _ in range(50):
        alone.advance([1.0, 1.0, 1.0], [False] * 3)
    for _ in range(50):
        first.advance([1.0, 1.0, 1.0], [False] * 3)
        second.advance([-9.0, 2.0, 0.0], [False] * 3)
    assert first.true_state() == alone.true_state()
