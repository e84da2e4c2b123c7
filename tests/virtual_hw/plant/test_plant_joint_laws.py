"""Every law of a joint does what its formula says: measured on a pendulum, mostly without gravity."""

from __future__ import annotations

import math

import numpy as np
import pytest

from virtual_hw.plant import Plant

FREE = [False]
INERTIA = 0.6
TRUE_CURRENT = '[[motor]]\njoint = "swing"\nbandwidth_hz = 1e7\n'


def friction(keys: str) -> str:
    return f'[[friction]]\njoint = "swing"\n{keys}\n'


def run(plant: Plant, torque: float, ticks: int) -> np.ndarray:
    """True speed after each tick under a constant torque."""
    speeds = []
    for _ in range(ticks):
        plant.advance([torque], FREE)
        speeds.append(plant.true_state()[1][0])
    return np.array(speeds)


def ramp(plant: Plant, end: float, begin: float = 0.0) -> None:
    """From torque ``begin`` to ``end`` in 2 s, then a second there."""
    for k in range(3000):
        plant.advance([begin + (end - begin) * min(1.0, k / 2000)], FREE)


def acceleration(make_pendulum, hidden: str, torque: float, home: float = 0.0) -> float:
    plant = make_pendulum(hidden, gravity=False, home=home)
    return float(run(plant, torque, 4)[-1] / 4e-3)


def drag_torque_at(make_pendulum, hidden: str, speed: float, home: float = 0.0) -> float:
    """Torque that friction spends when a stiff velocity servo drags the joint at ``speed``."""
    plant = make_pendulum(TRUE_CURRENT + hidden, gravity=False, home=home)
    spent = []
    torque = 0.0
    integral = 0.0
    for k in range(1500):
        plant.advance([torque], FREE)
        error = speed - plant.true_state()[1][0]
        integral += 2.0 * error
        torque = 60.0 * error + integral
        if k >= 1000:
            spent.append(torque)
    return float(np.mean(spent))


def test_stuck_below_breakaway_and_sliding_above(make_pendulum):
    law = friction("level_nm = 2.0\nbreakaway_factor = 1.5\nstribeck_velocity_rad_s = 0.05")
    stuck = make_pendulum(law, gravity=False)
    ramp(stuck, 2.7)
    assert abs(stuck.true_state()[0][0]) < 1e-3
    assert abs(stuck.true_state()[1][0]) < 1e-6
    sliding = make_pendulum(law, gravity=False)
    ramp(sliding, 3.3)
    assert sliding.true_state()[0][0] > 1.0


def test_friction_holds_a_load_for_a_minute_without_creeping(make_pendulum):
    plant = make_pendulum(friction("level_nm = 12.0"))
    run(plant, 0.0, 500)
    settled = plant.true_state()[0][0]
    run(plant, 0.0, 60_000)
    assert plant.true_state()[0][0] == pytest.approx(settled, abs=1e-9)
    assert 0 < settled < 2e-3


def test_presliding_is_a_spring_with_memory(make_pendulum):
    plant = make_pendulum(TRUE_CURRENT + friction("level_nm = 2.0\npresliding_rad = 1e-3"), gravity=False)
    ramp(plant, 1.0)
    # dF/dx = σ0·(1 − F/level) gives x = −(level/σ0)·ln(1 − F/level).
    there = 1e-3 * math.log(2)
    assert plant.true_state()[0][0] == pytest.approx(there, rel=0.06)
    ramp(plant, 0.0, begin=1.0)
    # Unloading, dF/dx = σ0·(1 + F/level) is stiffer: x goes back by (level/σ0)·ln(1 + 1/2), and the rest has slipped.
    assert plant.true_state()[0][0] == pytest.approx(there - 1e-3 * math.log(1.5), abs=5e-5)


@pytest.mark.parametrize("speed", [-2.0, -0.3, 0.3, 2.0])
def test_coulomb_and_viscous_friction(make_pendulum, speed):
    law = friction("level_nm = 1.5\nviscous_nms_rad = 0.4\ndrag_nms2_rad2 = 0.1")
    expected = 1.5 * math.copysign(1, speed) + 0.4 * speed + 0.1 * abs(speed) * speed
    assert drag_torque_at(make_pendulum, law, speed) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("speed", [-2.0, -0.3, 0.05, 0.3, 2.0])
def test_viscous_friction_of_a_power_law_fluid(make_pendulum, speed):
    law = friction("level_nm = 0.0\nviscous_nms_rad = 0.4\nviscous_exponent = 0.6")
    expected = 0.4 * math.copysign(abs(speed) ** 0.6, speed)
    assert drag_torque_at(make_pendulum, law, speed) == pytest.approx(expected, rel=1e-3)


@pytest.mark.parametrize("speed", [0.02, 0.05, 0.1, 0.5])
def test_stribeck_curve(make_pendulum, speed):
    law = friction(
        "level_nm = 1.0\nbreakaway_factor = 1.8\nstribeck_velocity_rad_s = 0.05\nbristle_damping_nms_rad = 20.0"
    )
    expected = 1.0 + 0.8 * math.exp(-((speed / 0.05) ** 2))
    assert drag_torque_at(make_pendulum, law, speed) == pytest.approx(expected, rel=0.02)


def test_asymmetric_friction(make_pendulum):
    law = friction("level_nm = 1.0\nlevel_negative_nm = 2.0\nviscous_nms_rad = 0.1\nviscous_negative_nms_rad = 0.5")
    assert drag_torque_at(make_pendulum, law, 1.0) == pytest.approx(1.1, rel=1e-3)
    assert drag_torque_at(make_pendulum, law, -1.0) == pytest.approx(-2.5, rel=1e-3)


def test_rough_place_is_rough_there_alone(make_pendulum):
    law = friction("level_nm = 1.0\nrough_place = [{ centre_rad = 1.25, width_rad = 1.0, increase = 1.0 }]")
    # At 1 rad/s the averaged half second runs from 1.0 to 1.5 rad, and from 11 to 11.5 rad.
    assert drag_torque_at(make_pendulum, law, 1.0) == pytest.approx(2.0, rel=0.02)
    assert drag_torque_at(make_pendulum, law, 1.0, home=10.0) == pytest.approx(1.0, rel=1e-3)


def test_running_in(make_pendulum):
    law = friction("level_nm = 1.0\nrunning_in = { initial_factor = 3.0, time_constant_s = 0.2 }")
    plant = make_pendulum(TRUE_CURRENT + law, gravity=False)
    speeds = run(plant, 5.0, 2000)
    early = (speeds[209] - speeds[189]) / 0.02
    late = (speeds[-1] - speeds[-101]) / 0.1
    factor = 1.0 + 2.0 * math.exp(-0.2 / 0.2)
    assert early * INERTIA == pytest.approx(5.0 - factor, rel=0.01)
    assert late * INERTIA == pytest.approx(4.0, rel=0.01)


def test_load_dependent_friction_grows_with_the_torque(make_pendulum):
    law = TRUE_CURRENT + friction("level_nm = 0.5\nload_coefficient = 0.1")
    speeds = run(make_pendulum(law, gravity=False), 20.0, 400)
    transmitted = (speeds[-1] - speeds[-101]) / 0.1 * INERTIA
    # What is transmitted is less the friction: T = 20 − 0.5 − 0.1·T.
    assert transmitted == pytest.approx(19.5 / 1.1, rel=1e-3)


@pytest.mark.parametrize("substeps", [1, 4])
def test_friction_falls_as_the_motor_warms(make_pendulum, substeps):
    law = (
        f"substeps = {substeps}\n"
        + friction("level_nm = 0.0\nviscous_nms_rad = 2.0\nviscous_per_kelvin = -0.02")
        + '[[motor]]\njoint = "swing"\nthermal = { capacity_j_k = 2.0, resistance_k_w = 0.5, loss_w_nm2 = 1.0 }\n'
    )
    plant = make_pendulum(law, gravity=False)
    assert plant.temperature(0) == 22.0
    run(plant, 4.0, 200)
    # At first the heat is stored: C·ΔT = ∫(r·τ² + friction power).
    assert plant.temperature(0) - 22.0 == pytest.approx(0.2 * 16.0 / 2.0, rel=0.2)
    speeds = run(plant, 4.0, 8000)
    # Steady: r·τ² + |friction power| = ΔT/R, at the speed that the weakened friction allows.
    kelvin = plant.temperature(0) - 22.0
    assert kelvin == pytest.approx(0.5 * (16.0 + 4.0 * speeds[-1]), rel=0.01)
    assert speeds[-1] == pytest.approx(4.0 / (2.0 * (1 - 0.02 * kelvin)), rel=0.01)


def test_rotor_inertia_adds_to_the_link(make_pendulum):
    bare = acceleration(make_pendulum, TRUE_CURRENT, 6.0)
    loaded = acceleration(
        make_pendulum, TRUE_CURRENT + '[[rotor_inertia]]\njoint = "swing"\ninertia_kg_m2 = 0.4\n', 6.0
    )
    assert bare == pytest.approx(10.0, rel=1e-3)
    assert loaded == pytest.approx(6.0, rel=1e-3)


@pytest.mark.parametrize(
    ("hidden", "home", "expected"),
    [
        ('[[joint_spring]]\njoint = "swing"\nstiffness_nm_rad = 3.0\ncentre_rad = 0.2\n', 0.7, -1.5),
        ('[[joint_spring]]\njoint = "swing"\nstiffness_nm_rad = 3.0\ncubic_nm_rad3 = 8.0\n', 0.5, -2.5),
        ('[[cogging]]\njoint = "swing"\norder = 7\namplitude_nm = 0.8\nphase_rad = 0.4\n', 0.3, -0.8 * math.sin(2.5)),
        (
            '[[cable]]\njoint = "swing"\nstiffness_nm_rad = 4.0\nelastic_share = 0.5\ncentre_rad = 0.1\n',
            0.6,
            -1.0,
        ),
        (
            '[[counterbalance]]\njoint = "swing"\nanchor_m = 0.4\nrod_m = 0.1\naligned_rad = 0.0\n'
            "preload_n = 500.0\ngas_travel_m = 0.6\npolytropic = 1.3\n",
            1.0,
            None,
        ),
    ],
)
def test_torques_that_depend_on_the_angle(make_pendulum, hidden, home, expected):
    if expected is None:
        # The gas stores the energy: torque is the slope of ∫F dL, here by differences.
        def length(q: float) -> float:
            return math.sqrt(0.16 + 0.01 - 0.08 * math.cos(q))

        def energy(q: float) -> float:
            travel = np.linspace(0.0, length(q) - 0.3, 4001)
            return float(np.trapezoid(500.0 * (0.6 / (0.6 - travel)) ** 1.3, travel))

        expected = -(energy(home + 1e-4) - energy(home - 1e-4)) / 2e-4
    speed = run(make_pendulum(hidden, gravity=False, home=home), 0.0, 1)[-1]
    assert speed / 1e-3 * INERTIA == pytest.approx(expected, rel=1e-3)


def test_cable_loses_energy_every_cycle_and_a_spring_does_not(make_pendulum):
    def work(hidden: str) -> float:
        plant = make_pendulum(TRUE_CURRENT + hidden, gravity=False)
        total, torque = 0.0, 0.0
        for k in range(8000):
            target = 0.5 * math.sin(2 * math.pi * k / 2000)
            before = plant.true_state()[0][0]
            plant.advance([torque], FREE)
            (q,), (dq,) = plant.true_state()
            if k >= 4000:
                total += torque * (q - before)
            torque = 800.0 * (target - q) - 30.0 * (dq - 0.5 * 2 * math.pi / 2 * math.cos(2 * math.pi * k / 2000))
        return total / 2

    spring = work('[[joint_spring]]\njoint = "swing"\nstiffness_nm_rad = 6.0\n')
    cable = work('[[cable]]\njoint = "swing"\nstiffness_nm_rad = 6.0\nelastic_share = 0.0\nyield_rad = 0.1\n')
    assert abs(spring) < 0.01
    # Nearly a parallelogram, 2·k·x high and 2·(0.5 − x) wide: 4·k·x·(0.5 − x) = 0.96 J less its round corners.
    assert 0.6 < cable < 0.97


def test_elastic_joint_rings_at_its_resonance(make_pendulum):
    hidden = (
        TRUE_CURRENT
        + '[[rotor_inertia]]\njoint = "swing"\ninertia_kg_m2 = 0.3\n'
        + '[[elasticity]]\njoint = "swing"\nstiffness_nm_rad = 2000.0\nencoder = "link"\n'
    )
    plant = make_pendulum(hidden, gravity=False)
    run(plant, 50.0, 3)
    speeds = run(plant, 0.0, 4000)
    spectrum = np.abs(np.fft.rfft((speeds - speeds.mean()) * np.hanning(4000)))
    found = np.argmax(spectrum) / 4.0
    reduced = 0.3 * INERTIA / (0.3 + INERTIA)
    assert found == pytest.approx(math.sqrt(2000.0 / reduced) / 2 / math.pi, abs=0.3)


def test_elastic_joint_sags_under_gravity_and_its_motor_encoder_does_not_see_it(make_pendulum):
    hidden = (
        '[[rotor_inertia]]\njoint = "swing"\ninertia_kg_m2 = 0.3\n'
        '[[elasticity]]\njoint = "swing"\nstiffness_nm_rad = 2000.0\ndamping_nms_rad = 1.0\nencoder = "{}"\n'
    )
    for encoder, shift in (("motor", 2.0 * 9.81 * 0.5 / 2000.0), ("link", 0.0)):
        plant = make_pendulum(hidden.format(encoder))
        for _ in range(300):
            plant.advance([0.0], [True])
        angle = plant.counts(0) * 2 * math.pi / 1_000_000
        # Held by the brake on the motor, which stands ahead of the link against gravity.
        assert angle - plant.true_state()[0][0] == pytest.approx(-shift, abs=1e-5)
        assert plant.true_state()[0][0] == pytest.approx(0.0, abs=1e-6)


def test_backlash_leaves_the_link_free_inside_the_gap(make_pendulum):
    hidden = (
        '[[rotor_inertia]]\njoint = "swing"\ninertia_kg_m2 = 0.3\n'
        '[[elasticity]]\njoint = "swing"\nstiffness_nm_rad = 5000.0\ndamping_nms_rad = 5.0\ngap_rad = 0.02\n'
    )
    plant = make_pendulum(hidden, gravity=False)
    travel = 0.0
    while abs(plant.true_state()[1][0]) == 0.0:
        plant.advance([1.0], FREE)
        travel = plant.counts(0) * 2 * math.pi / 1_000_000
    # The motor crosses half the gap before the link feels anything.
    assert travel == pytest.approx(0.01, abs=5e-4)


@pytest.mark.parametrize(
    ("keys", "torque", "true"),
    [
        ("gain = 0.9", 10.0, 9.0),
        ("dead_zone_nm = 0.5", 10.0, 9.5),
        ("dead_zone_nm = 0.5", 0.4, 0.0),
        ("saturation_nm = 20.0", 15.0, 20.0 * math.tanh(0.75)),
        ("peak_torque_nm = 8.0", 12.0, 8.0),
        ("gain_per_kelvin = -0.01\nthermal = { capacity_j_k = 1e9, resistance_k_w = 1.0, loss_w_nm2 = 0.0, "
         "initial_c = 42.0 }", 10.0, 8.0),
    ],
)  # fmt: skip
def test_true_torque_behind_the_measured_one(make_pendulum, keys, torque, true):
    hidden = TRUE_CURRENT + keys + "\n"
    assert acceleration(make_pendulum, hidden, torque) * INERTIA == pytest.approx(true, rel=2e-3, abs=1e-9)
    plant = make_pendulum(hidden, gravity=False)
    run(plant, torque, 3)
    assert plant.torque(0) == pytest.approx(min(torque, 8.0) if "peak" in keys else torque)


def test_torque_ripple_scales_with_the_torque(make_pendulum):
    hidden = TRUE_CURRENT + '[[torque_ripple]]\njoint = "swing"\norder = 5\namplitude = 0.1\nphase_rad = 0.3\n'
    for torque in (5.0, -10.0):
        found = run(make_pendulum(hidden, gravity=False, home=0.7), torque, 1)[0] / 1e-3 * INERTIA
        assert found == pytest.approx(torque * (1 - 0.1 * math.sin(3.8)), rel=1e-3)


def test_current_loop_rises_with_its_time_constant(make_pendulum):
    plant = make_pendulum('[[motor]]\njoint = "swing"\nbandwidth_hz = 80.0\n', gravity=False)
    measured = []
    for _ in range(20):
        plant.advance([10.0], FREE)
        measured.append(plant.torque(0))
    expected = 10.0 * (1 - np.exp(-2 * math.pi * 80.0 * 1e-3 * np.arange(1, 21)))
    np.testing.assert_allclose(measured, expected, rtol=1e-9)
    # The impulse on the link is that of the same exponential.
    lag = 1 / (2 * math.pi * 80.0)
    impulse = 10.0 * (0.02 - lag * (1 - math.exp(-0.02 / lag)))
    assert plant.true_state()[1][0] * INERTIA == pytest.approx(impulse, rel=1e-4)


def test_torque_delay_of_a_fraction_of_a_tick(make_pendulum):
    hidden = TRUE_CURRENT + "delay_s = 2.25e-3\n"
    plant = make_pendulum(hidden, gravity=False)
    speeds = run(plant, 6.0, 10)
    # The link gets the impulse of 10 ms less 2.25 ms.
    assert speeds[-1] * INERTIA == pytest.approx(6.0 * (10e-3 - 2.25e-3), rel=1e-5)


def test_phase_currents_give_the_torque_by_equation_4_10(make_pendulum):
    keys = "torque_constant_nm_a = 4.0\npole_pairs = 6\n"
    plant = make_pendulum(TRUE_CURRENT + keys, gravity=False, home=0.37)
    plant.advance([7.0], [True])
    theta = 6 * plant.true_state()[0][0]
    currents = plant.currents(0)
    third = 2 * math.pi / 3
    assert sum(currents) == pytest.approx(0.0, abs=1e-12)
    assert 4.0 * sum(i * math.sin(theta + k * third) for k, i in enumerate(currents)) == pytest.approx(7.0)


def test_brake_closed_in_motion_stops_the_joint_with_its_torque(make_pendulum):
    plant = make_pendulum('[[motor]]\njoint = "swing"\nbrake_torque_nm = 30.0\n', gravity=False)
    run(plant, 30.0, 40)
    begin = plant.true_state()[1][0]
    ticks = 0
    while abs(plant.true_state()[1][0]) > 1e-3:
        plant.advance([0.0], [True])
        ticks += 1
        assert ticks < 200
    assert ticks * 1e-3 == pytest.approx(begin * INERTIA / 30.0, abs=3e-3)
