"""Payloads, tilt, walls, shared transmissions and the wrench between wrist and load, on a two-joint arm."""

from __future__ import annotations

import math

import numpy as np
import pytest

from virtual_hw.hidden import parse_hidden
from virtual_hw.plant import Plant, build_plant

FREE, HELD = [False, False], [True, True]
G = 9.81
WRIST_MASS, WRIST_CENTRE = 0.5, 0.05
PAYLOAD = "[payload]\nmass_kg = 1.2\ncentre_m = [0.03, 0.02, 0.1]\ninertia_kg_m2 = [0.01, 0, 0, 0.01, 0, 0.01]\n"
STILL = "".join(f'[[motor]]\njoint = "{j}"\nbandwidth_hz = 1e7\n' for j in ("turn", "lift"))


@pytest.fixture
def make(two_joints):
    def build(hidden: str = "", home: tuple[float, float] = (0.3, -0.4)) -> Plant:
        arm = two_joints.arm.model_copy(update={"home_rad": home})
        installation = two_joints.model_copy(update={"arm": arm})
        return build_plant(installation, parse_hidden(hidden, installation), 1)

    return build


def wrench_at_rest(plant: Plant, ticks: int = 300) -> np.ndarray:
    tap = plant.tap_wrench("wrist")
    for _ in range(ticks):
        plant.advance([0.0, 0.0], HELD)
    return np.array(tap[-1][1])


def down_in_wrist(lift: float) -> np.ndarray:
    """The direction of gravity in the wrist's frame: the arm turns about y by ``lift``."""
    return np.array([math.sin(lift), 0.0, -math.cos(lift)])


@pytest.mark.parametrize("lift", [0.0, -0.4, 1.2])
def test_wrench_is_what_the_sensor_exerts_on_its_load(make, lift):
    bare = wrench_at_rest(make(home=(0.3, lift)))
    holding = -WRIST_MASS * G * down_in_wrist(lift)
    np.testing.assert_allclose(bare[:3], holding, atol=1e-6)
    np.testing.assert_allclose(bare[3:], np.cross([0, 0, WRIST_CENTRE], holding), atol=1e-6)
    loaded = wrench_at_rest(make(PAYLOAD, home=(0.3, lift)))
    more = -1.2 * G * down_in_wrist(lift)
    np.testing.assert_allclose((loaded - bare)[:3], more, atol=1e-6)
    np.testing.assert_allclose((loaded - bare)[3:], np.cross([0.03, 0.02, 0.1], more), atol=1e-6)


def test_payload_comes_and_goes_at_its_times(make):
    plant = make(PAYLOAD.replace("[payload]", "[payload]\nfrom_s = 0.1\nuntil_s = 0.2"))
    tap = plant.tap_wrench("wrist")
    for _ in range(300):
        plant.advance([0.0, 0.0], HELD)
    weights = np.array([np.linalg.norm(w[:3]) / G for _, w in tap])
    np.testing.assert_allclose(weights[[50, 99]], WRIST_MASS, rtol=1e-3)
    np.testing.assert_allclose(weights[[190, 199]], WRIST_MASS + 1.2, rtol=1e-2)
    np.testing.assert_allclose(weights[[290, 299]], WRIST_MASS, rtol=1e-2)


def test_wrench_of_a_turning_load_is_centripetal(make):
    plant = make(STILL, home=(0.0, 0.0))
    tap = plant.tap_wrench("wrist")
    for _ in range(400):
        before = plant.true_state()[1][0]
        plant.advance([3.0, 0.0], [False, True])
    # The wrench is that of the step's middle.
    speed = 0.5 * (before + plant.true_state()[1][0])
    # 0.4 m from the axis; the sensor pulls its load inward.
    assert tap[-1][1][0] == pytest.approx(-WRIST_MASS * speed**2 * 0.4, rel=1e-5)


def test_base_tilt_turns_gravity(make):
    def fall(hidden: str) -> np.ndarray:
        plant = make(STILL + hidden, home=(0.5, 0.0))
        plant.advance([0.0, 0.0], FREE)
        return np.array(plant.true_state()[1])

    assert fall("")[0] == pytest.approx(0.0, abs=1e-12)
    tilted = fall("[base_tilt]\nroll_rad = 0.1\npitch_rad = 0.05\n")
    # Pitched about y the base sees gravity lean along −x·sin(pitch)…: the turret is pushed about z.
    mass_arm = 3.0 * 0.2 + 0.5 * 0.4
    inertia = 0.3 + 0.08 + 3.0 * 0.04 + 0.001 + 0.5 * 0.16
    gx, gy = G * math.sin(0.05), -G * math.cos(0.05) * math.sin(0.1)
    torque = mass_arm * (math.cos(0.5) * gy - math.sin(0.5) * gx)
    assert tilted[0] == pytest.approx(torque / inertia * 1e-3, rel=2e-3)


def test_push_lasts_its_time(make):
    plant = make(
        STILL + '[[push]]\nlink = "wrist"\nforce_n = [0.0, 4.0, 0.0]\nfrom_s = 0.01\nuntil_s = 0.03\n', (0.0, 0.0)
    )
    speeds = []
    for _ in range(60):
        plant.advance([0.0, 0.0], [False, True])
        speeds.append(plant.true_state()[1][0])
    inertia = 0.3 + 0.08 + 3.0 * 0.04 + 0.001 + 0.5 * 0.16
    assert speeds[9] == pytest.approx(0.0, abs=1e-12)
    assert speeds[-1] == pytest.approx(4.0 * 0.4 * 0.02 / inertia, rel=1e-2)
    assert speeds[31] == pytest.approx(speeds[-1], rel=1e-3)


def test_wall_stops_the_tool_and_lets_it_go(make):
    wall = '[[wall]]\nlink = "wrist"\npoint_m = [0.0, 0.1, 0.0]\nnormal = [0.0, -1.0, 0.0]\nstiffness_n_m = 2e4\n'
    plant = make(STILL + wall, (0.0, 0.0))
    reached = []
    for _ in range(3000):
        plant.advance([0.5, 0.0], [False, True])
        reached.append(0.4 * math.sin(plant.true_state()[0][0]))
    assert 0.1 < max(reached) < 0.1 + 0.02
    # It bounced, as a wall without damping makes it.
    assert min(reached[reached.index(max(reached)) :]) < 0.05


def test_shared_transmission_inertia_couples_the_two_joints(make):
    shared = '[[shared_transmission]]\njoint = "turn"\njoint_other = "lift"\nratio = 0.5\ninertia_kg_m2 = 0.8\n'
    plain, coupled = make(STILL, (0.0, 0.0)), make(STILL + shared, (0.0, 0.0))
    for plant in (plain, coupled):
        plant.advance([2.0, 0.0], FREE)
    (a, g), (c, d) = plain.true_state()[1], coupled.true_state()[1]
    # M·ddq = tau + gravity, M' = M + 0.8·[1, ½]ᵀ[1, ½]; M is diagonal at this pose.
    m1, m2 = 2.0 / (a / 1e-3), 0.08 + 3.0 * 0.04 + 0.001 + 0.5 * (0.16 + WRIST_CENTRE**2)
    mass = np.diag([m1, m2]) + 0.8 * np.outer([1.0, 0.5], [1.0, 0.5])
    expected = np.linalg.solve(mass, [2.0, m2 * g / 1e-3]) * 1e-3
    np.testing.assert_allclose([c, d], expected, rtol=1e-3)


def test_shared_transmission_friction_acts_on_the_combined_speed(make):
    shared = (
        '[[shared_transmission]]\njoint = "turn"\njoint_other = "lift"\nratio = -1.0\nviscous_nms_rad = 3.0\n'
        "level_nm = 0.0\n"
    )
    plant = make(STILL + shared, (0.0, 0.0))
    for _ in range(3000):
        plant.advance([6.0, 0.0], [False, True])
    # Lift is held, so turn alone drags the shaft: 6 N·m = 3·dq.
    assert plant.true_state()[1][0] == pytest.approx(2.0, rel=1e-2)


def test_gear_mesh_acts_on_both_joints_with_the_phase_of_both(make):
    mesh = (
        '[[gear_mesh]]\njoint = "turn"\njoint_other = "lift"\norder = 3.0\norder_other = 5.0\n'
        "amplitude_nm = 0.6\nphase_rad = 0.2\nratio = 0.5\n"
    )
    plain, beating = make(STILL), make(STILL + mesh)
    for plant in (plain, beating):
        plant.advance([0.0, 0.0], FREE)
    spent = 0.6 * math.sin(3.0 * 0.3 + 5.0 * -0.4 + 0.2)
    (a, b), (c, d) = plain.true_state()[1], beating.true_state()[1]
    driven = make(STILL)
    driven.advance([-spent, -0.5 * spent], FREE)
    np.testing.assert_allclose([c, d], driven.true_state()[1], rtol=1e-3)
    assert (c, d) != (a, b)


def test_sloshing_load_swings_at_its_frequency_and_weighs_what_it_weighs(make):
    load = "[sloshing_load]\nmass_kg = 0.8\ncentre_m = [0.0, 0.0, 0.1]\nfrequency_hz = 6.0\ndamping = 0.01\n"
    plant = make(load, (0.0, 0.0))
    tap = plant.tap_wrench("wrist")
    for k in range(6000):
        plant.advance([20.0 if k < 20 else 0.0, 0.0], [k >= 20, True])
    across = np.array([w[1] for _, w in tap])[1000:]
    spectrum = np.abs(np.fft.rfft((across - across.mean()) * np.hanning(len(across))))
    assert np.argmax(spectrum) / (len(across) * 1e-3) == pytest.approx(6.0, abs=0.3)
    assert np.mean([w[2] for _, w in tap][-1000:]) == pytest.approx((0.8 + WRIST_MASS) * G, rel=1e-3)


def test_compliant_sensor_rings_at_its_resonance_with_the_load(make):
    compliance = (
        '[[wrench_sensor]]\nsensor = "wrist"\ncompliance = [{ axis = "y", stiffness = 2000.0, damping = 0.01 }]\n'
    )
    plant = make(compliance + PAYLOAD.replace("0.03, 0.02, 0.1", "0, 0, 0"), (0.0, 0.0))
    tap = plant.tap_wrench("wrist")
    for k in range(4000):
        plant.advance([30.0 if k < 10 else 0.0, 0.0], [k >= 10, True])
    across = np.array([w[1] for _, w in tap])[100:]
    spectrum = np.abs(np.fft.rfft((across - across.mean()) * np.hanning(len(across))))
    expected = math.sqrt(2000.0 / 1.7) / 2 / math.pi
    assert np.argmax(spectrum) / (len(across) * 1e-3) == pytest.approx(expected, abs=0.3)


def test_link_changes(make):
    heavy = make('[[link_change]]\nlink = "wrist"\nmass_factor = 1.5\ncentre_shift_m = [0.01, 0.0, 0.0]\n', (0.0, 0.0))
    force = wrench_at_rest(heavy)
    assert force[2] == pytest.approx(0.75 * G)
    assert force[4] == pytest.approx(-0.01 * 0.75 * G)
