"""What the drive's sensors say about the true motion, and that they never change it."""

from __future__ import annotations

import math

import numpy as np
import pytest

from config import InputError
from virtual_hw.hidden import parse_hidden
from virtual_hw.plant import Plant, build_plant

FREE = [False]
COUNTS_PER_RAD = 1_000_000 / (2 * math.pi)


def swing(plant: Plant, ticks: int = 400) -> dict[str, np.ndarray]:
    rows = []
    for k in range(ticks):
        plant.advance([8.0 * math.sin(0.02 * k)], FREE)
        (q,), (dq,) = plant.true_state()
        rows.append((q, dq, plant.counts(0) / COUNTS_PER_RAD, plant.velocity(0), plant.torque(0)))
    return dict(zip(("q", "dq", "angle", "velocity", "torque"), np.array(rows).T, strict=True))


def sensor(table: str, keys: str) -> str:
    return f'[[{table}]]\njoint = "swing"\n{keys}\n'


def test_a_clean_encoder_is_right_to_half_a_count_and_the_tachometer_exact(make_pendulum):
    seen = swing(make_pendulum())
    assert np.abs(seen["angle"] - seen["q"]).max() <= 0.5001 / COUNTS_PER_RAD
    np.testing.assert_array_equal(seen["velocity"], seen["dq"])


@pytest.mark.parametrize(("sign", "zero"), [(1, 0.0), (-1, 0.0), (1, 1.25), (-1, -0.4)])
def test_counts_are_the_inverse_of_the_installation_s_angle(pendulum, sign, zero):
    encoder = pendulum.joint[0].encoder.model_copy(update={"sign": sign, "zero_rad": zero})
    joint = pendulum.joint[0].model_copy(update={"encoder": encoder})
    arm = pendulum.arm.model_copy(update={"home_rad": (0.9,)})
    installation = pendulum.model_copy(update={"joint": (joint,), "arm": arm})
    plant = build_plant(installation, parse_hidden("", installation), 1)
    assert sign * plant.counts(0) / COUNTS_PER_RAD + zero == pytest.approx(0.9, abs=0.501 / COUNTS_PER_RAD)


CASES = {
    "offset": (sensor("angle_sensor", "offset_rad = 0.01"), "angle", lambda s: s["q"] - 0.01),
    "eccentricity": (
        sensor("angle_sensor", "eccentricity_rad = 0.02\neccentricity_phase_rad = 0.5"),
        "angle",
        lambda s: s["q"] + 0.02 * np.sin(s["q"] + 0.5),
    ),
    "interpolation": (
        sensor("angle_sensor", "interpolation_rad = 0.003\ninterpolation_order = 20"),
        "angle",
        lambda s: s["q"] + 0.003 * np.sin(20 * s["q"]),
    ),
    "angle delay": (sensor("angle_sensor", "delay_s = 3e-3"), "angle", lambda s: np.r_[[0.0] * 3, s["q"][:-3]]),
    "velocity gain": (sensor("velocity_sensor", "gain = 1.05"), "velocity", lambda s: 1.05 * s["dq"]),
    "velocity offset": (sensor("velocity_sensor", "offset_rad_s = 0.1"), "velocity", lambda s: s["dq"] + 0.1),
    "velocity ripple": (
        sensor("velocity_sensor", "ripple = 0.1\nripple_order = 9"),
        "velocity",
        lambda s: s["dq"] * (1 + 0.1 * np.sin(9 * s["q"])),
    ),
    "velocity delay": (
        sensor("velocity_sensor", "delay_s = 1.5e-3"),
        "velocity",
        lambda s: 0.5 * (np.r_[0.0, s["dq"][:-1]] + np.r_[0.0, 0.0, s["dq"][:-2]]),
    ),
    "torque offset": (sensor("torque_sensor", "offset_nm = 0.7"), "torque", lambda s: s["clean_torque"] + 0.7),
    "torque delay": (
        sensor("torque_sensor", "delay_s = 2e-3"),
        "torque",
        lambda s: np.r_[[0.0] * 2, s["clean_torque"][:-2]],
    ),
}


@pytest.mark.parametrize("case", CASES)
def test_a_sensor_error_changes_its_channel_alone(make_pendulum, case):
    hidden, channel, expected = CASES[case]
    clean, seen = swing(make_pendulum()), swing(make_pendulum(hidden))
    seen["clean_torque"] = clean["torque"]
    np.testing.assert_array_equal(seen["q"], clean["q"])
    np.testing.assert_array_equal(seen["dq"], clean["dq"])
    for other in {"angle", "velocity", "torque"} - {channel}:
        np.testing.assert_array_equal(seen[other], clean[other])
    tolerance = 0.51 / COUNTS_PER_RAD if channel == "angle" else 1e-9
    np.testing.assert_allclose(seen[channel], expected(seen), atol=tolerance)


@pytest.mark.parametrize("table", ["angle_sensor", "velocity_sensor", "torque_sensor"])
def test_noise_has_its_deviation_and_colour(make_pendulum, table):
    channel = {"angle_sensor": "angle", "velocity_sensor": "velocity", "torque_sensor": "torque"}[table]
    hidden = sensor(table, "noise = { white = 0.03, coloured = 0.04, corner_hz = 20.0 }")
    clean, seen = swing(make_pendulum(), 8000), swing(make_pendulum(hidden), 8000)
    noise = seen[channel] - clean[channel]
    assert noise.std() == pytest.approx(0.05, rel=0.06)
    # White is gone after one sample; coloured has fallen to exp(−2π·20 Hz·1 ms).
    lag1 = float(np.mean(noise[1:] * noise[:-1]))
    assert lag1 == pytest.approx(0.04**2 * math.exp(-2 * math.pi * 0.02), rel=0.2)
    np.testing.assert_array_equal(seen["q"], clean["q"])


def test_without_a_tachometer_the_drive_differentiates_its_counts(pendulum):
    name = pendulum.joint[0].drive
    drive = pendulum.drives[name]
    layouts = {
        mode: layout.model_copy(update={"tpdo": tuple(tuple(o for o in pdo if o != "velocity") for pdo in layout.tpdo)})
        for mode, layout in drive.layouts.items()
    }
    installation = pendulum.model_copy(update={"drives": {name: drive.model_copy(update={"layouts": layouts})}})
    plant = build_plant(installation, parse_hidden(sensor("velocity_sensor", "bandwidth_hz = 1e6"), installation), 1)
    last = plant.counts(0)
    for k in range(200):
        plant.advance([3.0 * math.sin(0.1 * k)], FREE)
        assert plant.velocity(0) == pytest.approx((plant.counts(0) - last) / COUNTS_PER_RAD / 1e-3, rel=1e-9, abs=1e-12)
        last = plant.counts(0)
    smooth = build_plant(installation, parse_hidden("", installation), 1)
    seen = swing(smooth)
    assert np.abs(seen["velocity"] - seen["dq"])[50:].max() < 0.05 * np.abs(seen["dq"]).max()


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[[friction]]\njoint = "elbow"\nlevel_nm = 1.0\n', ("friction[0].joint", "'elbow'", "swing")),
        ('[[friction]]\njoint = "swing"\nlevel = 1.0\n', ("level",)),
        ('[[friction]]\njoint = "swing"\nlevel_nm = -1.0\n', ("level_nm",)),
        ('[[elasticity]]\njoint = "swing"\nstiffness_nm_rad = 10.0\n', ("rotor_inertia",)),
        ('[[friction]]\njoint = "swing"\nlevel_nm = 1\n' * 2, ("twice",)),
        ('[[link_change]]\nlink = "claw"\n', ("'claw'", "rod")),
        ("[payload]\nmass_kg = 1.0\ninertia_kg_m2 = [1.0, 0, 0, 1.0, 0, 3.0]\n", ("principal moments", "no body")),
        ('extends = "nothing"\n', ("nothing", "dda")),
        ("tick_us = [\n", ("TOML",)),
        ("tick_us = 123\n", ("tick_us",)),
        (
            '[[rotor_inertia]]\njoint = "swing"\ninertia_kg_m2 = 0.001\n'
            '[[elasticity]]\njoint = "swing"\nstiffness_nm_rad = 1e5\n',
            ("swing", "stiffness", "substeps"),
        ),
    ],
)
def test_wrong_mechanics_are_refused_by_name(pendulum, text, words):
    with pytest.raises(InputError) as refusal:
        build_plant(pendulum, parse_hidden(text, pendulum), 1)
    for word in words:
        assert word in str(refusal.value)


def test_a_cycle_that_the_servo_tick_does_not_divide_is_refused(pendulum):
    cycle = pendulum.cycle.model_copy(update={"rate_hz": 800.0})
    installation = pendulum.model_copy(update={"cycle": cycle})
    with pytest.raises(InputError, match="1250 µs are no multiple of the servo tick"):
        build_plant(installation, parse_hidden("", installation), 1)
    build_plant(installation, parse_hidden("tick_us = 250", installation), 1)


def test_a_file_extends_another_joint_by_joint(pendulum, tmp_path):
    (tmp_path / "base.toml").write_text(
        sensor("friction", "level_nm = 1.0\nviscous_nms_rad = 0.5") + sensor("cogging", "order = 1\namplitude_nm = 0.1")
    )
    hidden = parse_hidden(
        'extends = "base.toml"\n'
        + sensor("friction", "level_nm = 2.0")
        + sensor("cogging", "order = 2\namplitude_nm = 0.2"),
        pendulum,
    )
    assert (hidden.friction[0].level_nm, hidden.friction[0].viscous_nms_rad) == (2.0, 0.5)
    assert [c.order for c in hidden.cogging] == [1, 2]
    (tmp_path / "base.toml").write_text('extends = "base.toml"\n')
    with pytest.raises(InputError, match="extends itself"):
        parse_hidden('extends = "base.toml"\n', pendulum)
