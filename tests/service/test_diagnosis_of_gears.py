"""A CSV with the angles of motors and of encoders behind their gears: what winds up between them is named."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config import InputError
from driver.recording import read_recording
from driver.recording.csv_recording import write_csv
from service.diagnosis.diagnosing import diagnose_recordings
from service.diagnosis.request import DiagnoseRequest
from service.models.model_file import read_model

STIFFNESS, COULOMB, LATE, RATIO = 21e3, 2.5, 3e-3, 121.0
COUNT = 2e-6
"""rad of the encoders behind the gears; the motors' are as much finer as their gears turn faster."""
LENGTHS, MASSES = (0.42, 0.31), (3.1, 1.9)
NOISE = 0.2
URDF = f"""<robot name='stranger'><link name='base'/>
<link name='upper'><inertial><origin xyz='{LENGTHS[0]} 0 0'/><mass value='{MASSES[0]}'/>
<inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial></link>
<link name='fore'><inertial><origin xyz='{LENGTHS[1]} 0 0'/><mass value='{MASSES[1]}'/>
<inertia ixx='1e-6' iyy='1e-6' izz='1e-6' ixy='0' ixz='0' iyz='0'/></inertial></link>
<joint name='shoulder' type='revolute'><parent link='base'/><child link='upper'/><origin rpy='1.5707963267948966 0 0'/>
<axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='5' effort='90'/></joint>
<joint name='elbow' type='revolute'><parent link='upper'/><child link='fore'/><origin xyz='{LENGTHS[0]} 0 0'/>
<axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='5' effort='90'/></joint></robot>
"""


def pendulum(q: np.ndarray, dq: np.ndarray, ddq: np.ndarray) -> np.ndarray:
    """Torques of two point masses at the ends of two rods in a vertical plane, by hand."""
    (l1, l2), (m1, m2), g = LENGTHS, MASSES, 9.81
    c, s = np.cos(q[:, 1]), np.sin(q[:, 1])
    cross = m2 * l1 * l2
    far = m2 * g * l2 * np.cos(q.sum(axis=1))
    elbow = m2 * l2**2 * ddq.sum(axis=1) + cross * (c * ddq[:, 0] + s * dq[:, 0] ** 2) + far
    shoulder = (
        (m1 + m2) * l1**2 * ddq[:, 0]
        + m2 * l2**2 * ddq.sum(axis=1)
        + cross * (c * (ddq[:, 0] + ddq.sum(axis=1)) - s * (dq[:, 1] ** 2 + 2.0 * dq[:, 0] * dq[:, 1]))
        + (m1 + m2) * g * l1 * np.cos(q[:, 0])
        + far
    )
    return np.column_stack([shoulder, elbow])


def motion(t: np.ndarray, seed: int) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    random = np.random.default_rng(seed)
    w = 2.0 * np.pi * np.array([[0.11, 0.37, 0.83], [0.17, 0.29, 0.97]])
    a = np.array([[0.7, 0.4, 0.12], [0.8, 0.5, 0.15]]) * random.uniform(0.8, 1.2, (2, 3))
    phase = w * t[:, None, None] + random.uniform(0.0, 6.0, (2, 3))
    q, dq, ddq = ((f * a * w**k).sum(axis=2) for k, f in enumerate((np.sin(phase), np.cos(phase), -np.sin(phase))))
    return q, dq, ddq


def recording(path: Path, seed: int, stiff: bool = False, late: float = 0.0, ratio: float = 1.0) -> Path:
    """The shoulder has one encoder, behind its gear; the elbow's gear winds up by what it carries, and its friction is
    the motor's. Each recording's encoders begin to count anew."""
    random = np.random.default_rng(100 + seed)
    t = np.arange(0.0, 14.0, 0.004)
    q, dq, ddq = motion(t, seed)
    carried = pendulum(q, dq, ddq)
    wound = np.zeros(len(t)) if stiff else carried[:, 1] / STIFFNESS
    motor = q[:, 1] + wound + random.uniform(-0.01, 0.01)
    seen = motion(t - late, seed)[0] if late else q
    driven = carried.copy()
    driven[:, 1] += COULOMB * np.sign(dq[:, 1])
    driven += NOISE * random.standard_normal(driven.shape)
    counted, motor = COUNT * np.round(seen / COUNT), ratio * COUNT / RATIO * np.round(motor / (COUNT / RATIO))
    names = ["t", "q_shoulder", "q_elbow", "q_motor_elbow", "tau_shoulder", "tau_elbow"]
    table = np.column_stack([t, counted, motor, driven])
    np.savetxt(path, table, "%.12g", ",", header=",".join(names), comments="")
    return path


def in_gears(answer: dict) -> dict[tuple[str, str | None], dict]:
    return {(f["effect"], f["joint"]): f["parameters"] for f in answer["findings"] if f["channel"] == "gear"}


@pytest.fixture
def urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))
    path = tmp_path / "stranger.urdf"
    path.write_text(URDF)
    return path


def test_a_gear_that_winds_up_is_named_with_its_stiffness(tmp_path: Path, urdf: Path) -> None:
    recordings = tuple(recording(tmp_path / f"{k}.csv", k) for k in range(2))
    answer = diagnose_recordings(DiagnoseRequest(recordings, arm=str(urdf), directory=tmp_path / "out")).answer
    found = in_gears(answer)
    assert set(found) == {("joint_elasticity", "elbow")}
    told = found["joint_elasticity", "elbow"]["stiffness"]
    assert told["value"] == pytest.approx(STIFFNESS, abs=4.0 * told["standard_error"])
    assert told["standard_error"] < 0.03 * STIFFNESS
    assert "the gear of joint elbow has joint elasticity" in answer["summary"]
    left = answer["gear_residual"]["elbow"]
    assert left["unit"] == "rad"
    assert left["after_rms"] < 0.1 * left["before_rms"]
    assert ("coulomb_friction", "elbow") in {(f["effect"], f["joint"]) for f in answer["findings"]}
    # It is no part of the torque along the angle behind the gear.
    assert "joint_elasticity" not in {effect.name for effect in read_model(tmp_path / "out" / "model.toml").effect}


def test_angles_that_are_late_behind_the_gear_are_told_from_a_spring(tmp_path: Path, urdf: Path) -> None:
    recordings = tuple(recording(tmp_path / f"{k}.csv", k, late=LATE) for k in range(2))
    found = in_gears(diagnose_recordings(DiagnoseRequest(recordings, arm=str(urdf))).answer)
    assert set(found) == {("joint_elasticity", "elbow"), ("transport_delay", None)}
    for parameters, name, truth in (
        (found["joint_elasticity", "elbow"], "stiffness", STIFFNESS),
        (found["transport_delay", None], "delay", LATE),
    ):
        told = parameters[name]
        assert told["value"] == pytest.approx(truth, abs=4.0 * told["standard_error"])


def test_of_a_stiff_gear_nothing_is_named(tmp_path: Path, urdf: Path) -> None:
    recordings = tuple(recording(tmp_path / f"{k}.csv", k, stiff=True) for k in range(2))
    assert not in_gears(diagnose_recordings(DiagnoseRequest(recordings, arm=str(urdf))).answer)


def test_an_angle_that_is_not_the_joints_is_refused(tmp_path: Path, urdf: Path) -> None:
    request = DiagnoseRequest((recording(tmp_path / "0.csv", 0, ratio=RATIO),), arm=str(urdf))
    with pytest.raises(InputError, match=r"the motor of elbow turns 121 times as far .*divided by the gear's ratio"):
        diagnose_recordings(request)


def test_angles_of_some_motors_are_read_and_written(tmp_path: Path) -> None:
    read = read_recording(recording(tmp_path / "0.csv", 0))
    assert read.joints == ("shoulder", "elbow")
    assert read.q_motor is not None
    assert np.isnan(read.q_motor[:, 0]).all()
    assert np.all(np.abs(read.q_motor[:, 1] - read.q[:, 1]) < 0.02)
    left = write_csv(read, tmp_path / "again.csv")
    assert left.samples == 0
    np.testing.assert_array_equal(read_recording(tmp_path / "again.csv").q_motor, read.q_motor)
