"""A CSV with the torques of joints' sensors and of their motors: what lies between them is named, and nothing else."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from driver.recording import read_recording
from service.diagnosis.diagnosing import diagnose_recordings
from service.diagnosis.request import DiagnoseRequest
from service.models.model_file import read_model
from tests.service.pendulum import pendulum

Array = NDArray[np.float64]

GAIN, ROTOR, COULOMB, VISCOUS = 0.85, 0.08, 1.7, 0.9
"""Of the shoulder's torque constant, and of the elbow's drive."""
NOISE = 0.2


def recording(path: Path, seed: int, hose: Sequence[tuple[float, float]] = ()) -> Path:
    """``hose``: elements beside the elbow's drive that follow its angle so far (rad), with so much torque (N·m)."""
    random = np.random.default_rng(seed)
    t = np.arange(0.0, 14.0, 0.004)
    w = 2.0 * np.pi * np.array([[0.11, 0.37, 0.83], [0.17, 0.29, 0.97]])
    a = np.array([[0.7, 0.4, 0.12], [0.8, 0.5, 0.15]]) * random.uniform(0.8, 1.2, (2, 3))
    p = random.uniform(0.0, 6.0, (2, 3))
    phase = w * t[:, None, None] + p
    q, dq, ddq = ((f * a * w**k).sum(axis=2) for k, f in enumerate((np.sin(phase), np.cos(phase), -np.sin(phase))))
    felt = pendulum(q, dq, ddq)
    driven = felt.copy()
    driven[:, 0] /= GAIN
    driven[:, 1] += ROTOR * ddq[:, 1] + COULOMB * np.sign(dq[:, 1]) + VISCOUS * dq[:, 1]
    for give, torque in hose:
        driven[:, 1] += torque / give * yielding(q[:, 1], give)
    felt, driven = (tau + NOISE * random.standard_normal(tau.shape) for tau in (felt, driven))
    names = [f"{what}_{joint}" for what in ("q", "tau", "tau_motor") for joint in ("shoulder", "elbow")]
    header = ",".join(["t", *names])
    np.savetxt(path, np.column_stack([t, q, felt, driven]), "%.9g", ",", header=header, comments="")
    return path


def yielding(q: Array, give: float) -> Array:
    """(samples,) rad by which a spring that slips beyond ``give`` is wound up."""
    wound = np.zeros_like(q)
    for k in range(1, len(q)):
        wound[k] = np.clip(wound[k - 1] + q[k] - q[k - 1], -give, give)
    return wound


def test_what_lies_between_motor_and_sensor_is_named(
    tmp_path: Path, urdf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))
    recordings = tuple(recording(tmp_path / f"{k}.csv", k) for k in range(2))
    answer = diagnose_recordings(DiagnoseRequest(recordings, arm=str(urdf), directory=tmp_path / "out")).answer
    found = {(f["effect"], f["joint"], f["channel"]): f["parameters"] for f in answer["findings"]}
    assert set(found) == {
        ("torque_constant_error", "shoulder", "motor"),
        ("rotor_inertia", "elbow", "motor"),
        ("coulomb_friction", "elbow", "motor"),
        ("viscous_friction", "elbow", "motor"),
    }
    told = {
        ("torque_constant_error", "gain"): GAIN,
        ("rotor_inertia", "inertia"): ROTOR,
        ("coulomb_friction", "level"): COULOMB,
        ("viscous_friction", "coefficient"): VISCOUS,
    }
    for (effect, _, _), parameters in found.items():
        for name, quantity in parameters.items():
            truth = told[effect, name]
            assert quantity["value"] == pytest.approx(truth, abs=max(4.0 * quantity["standard_error"], 0.02 * truth))
    assert "the drive of joint elbow has coulomb friction" in answer["summary"]
    drives = answer["drive_residual"]
    assert all(r["after_rms"] < 0.1 * r["before_rms"] for r in drives.values())
    # The sensor's torque is the model's: nothing of a drive is in the model of the arm.
    assert not read_model(tmp_path / "out" / "model.toml").effect


def test_a_hose_beside_a_drive_is_told_as_unexplained(
    tmp_path: Path, urdf: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))
    hose = [(0.15, 2.0), (0.3, 1.5), (0.6, 1.5)]
    recordings = tuple(recording(tmp_path / f"{k}.csv", k, hose) for k in range(2))
    answer = diagnose_recordings(DiagnoseRequest(recordings, arm=str(urdf), directory=tmp_path / "out")).answer
    assert answer["verdict"] == "unknown"
    assert "presliding" not in {f["effect"] for f in answer["findings"]}
    left = answer["unexplained"]["elbow"]
    assert left["signature"].startswith("a function of travel since reversals")
    assert left["signature"].endswith("between its motor and its sensor")
    assert left["share"] > 0.2


def test_torques_of_some_motors_are_refused(tmp_path: Path) -> None:
    path = tmp_path / "half.csv"
    path.write_text("t,q_a,q_b,tau_a,tau_b,tau_motor_a\n0,0,0,0,0,0\n")
    with pytest.raises(InputError, match="'tau_motor_b' is missing"):
        read_recording(path)


def test_a_joint_may_be_called_motor(tmp_path: Path) -> None:
    path = tmp_path / "named.csv"
    rows = "\n".join(f"{0.01 * k},{k},{2 * k}" for k in range(20))
    path.write_text(f"t,q_motor_x,tau_motor_x\n{rows}\n")
    read = read_recording(path)
    assert read.tau_motor is None
    assert read.tau is not None
    assert read.tau[3, 0] == 6.0
