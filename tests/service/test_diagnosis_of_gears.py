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
from tests.service.pendulum import pendulum

STIFFNESS, COULOMB, LATE, RATIO = 21e3, 2.5, 3e-3, 121.0
COUNT = 2e-6
"""rad of the encoders behind the gears; the motors' are as much finer as their gears turn faster."""
NOISE = 0.2


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


def test_gears_that_cannot_be_judged_do_not_end_the_diagnosis(tmp_path: Path, urdf: Path) -> None:
    """Their columns in one recording only, or a joint that stands still at its motor."""
    whole, other = (recording(tmp_path / f"{k}.csv", k) for k in range(2))
    header, *rows = other.read_text().splitlines()
    column = header.split(",").index("q_motor_elbow")

    def written(name: str, kept: int, value: str | None) -> Path:
        path = tmp_path / name
        fields = [line.split(",") for line in (header, *rows)]
        for k, line in enumerate(fields):
            line[column : column + 1] = [line[column] if k < kept else value] if value is not None else []
        path.write_text("\n".join(",".join(line) for line in fields) + "\n")
        return path

    without = diagnose_recordings(DiagnoseRequest((whole, written("without.csv", 0, None)), arm=str(urdf))).answer
    still = diagnose_recordings(DiagnoseRequest((written("still.csv", 1, "0.25"),), arm=str(urdf))).answer
    for answer, said in ((without, "not every recording has the columns q_motor"), (still, "no gear is judged")):
        assert not in_gears(answer)
        assert ("coulomb_friction", "elbow") in {(f["effect"], f["joint"]) for f in answer["findings"]}
        assert any(said in note for note in answer["notes"])
