"""`etude diagnose --drives-off`: what a friction that is larger one way and an offset make alike is told apart."""

from __future__ import annotations

import json
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config.loader import HERE
from estimator import inverse_dynamics, load_rigid_body
from service.cli.entry import run

DDA = HERE / "arms" / "dda" / "dda.urdf"
Array = NDArray[np.float64]
RATE = 250.0
NOISE = 0.3


@pytest.fixture(autouse=True)
def _state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))


def written(path: Path, t: Array, q: Array, tau: Array) -> str:
    joints = load_rigid_body(DDA).joints
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "tau") for joint in joints)])
    np.savetxt(path, np.column_stack([t, q, tau]), delimiter=",", header=header, comments="", fmt="%.9g")
    return str(path)


@pytest.fixture
def motions(tmp_path: Path) -> list[str]:
    """The direct drive arm, whose second joint rubs by 1.0 N·m one way and by 0.5 the other; each motion twice."""
    body, files = load_rigid_body(DDA), []
    for number in range(8):
        random = np.random.default_rng(number)
        t = np.arange(round(10.0 * RATE)) / RATE
        w = 2.0 * np.pi * np.array([0.31, 0.27 + 0.05 * (number % 4), 0.41])
        a = np.array([0.5, 0.8 - 0.1 * (number % 4), 0.6])
        q = a * np.sin(w * t[:, None]) + [3.5, 2.7, 1.7]
        dq, ddq = a * w * np.cos(w * t[:, None]), -a * w**2 * np.sin(w * t[:, None])
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 1] += np.where(dq[:, 1] > 0.0, 1.0, -0.5) + 0.2 * dq[:, 1]
        measured = tau + random.normal(0.0, NOISE, tau.shape)
        files.append(written(tmp_path / f"motion-{number}.csv", t, q + random.normal(0.0, 2e-6, q.shape), measured))
    return files


def off(tmp_path: Path, way: float = 0.0) -> str:
    """Twenty seconds of drives that are off."""
    random, t = np.random.default_rng(99), np.arange(round(20.0 * RATE)) / RATE
    q = np.array([3.5, 2.7, 1.7]) + way * np.sin(t)[:, None] + random.normal(0.0, 2e-6, (len(t), 3))
    return written(tmp_path / "drives-off.csv", t, q, random.normal(0.0, NOISE, q.shape))


def test_it_names_the_friction(motions: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    answers = []
    for beside in ((), ("--drives-off", off(tmp_path))):
        out = tmp_path / f"answer-{len(answers)}"
        assert run(["diagnose", *motions, "--arm", str(DDA), "--out", str(out), "--json", "-", *beside]) == 0
        answers.append(json.loads(capsys.readouterr().out))
    open_yet, decided = answers
    assert open_yet["drives_off"] == []
    (offset,) = [f for f in open_yet["findings"] if f["effect"] == "torque_offset"]
    assert offset["status"] == "ambiguous"
    assert [a["effect"] for a in offset["alternatives"]] == ["asymmetric_friction"]
    asked = offset["next_experiment"]
    assert asked["motion"] is None and asked["drives_off_s"] >= 15.0
    assert "with the drives off" in asked["sentence"] and asked["predicted_gap"] > 10.0
    page = (tmp_path / "answer-0" / "report.html").read_text(encoding="utf-8")
    assert "with the drives off" in page
    (friction,) = decided["findings"]
    assert (friction["effect"], friction["joint"], friction["status"]) == ("asymmetric_friction", "joint2", "named")
    for name, true in (("level_positive", 1.0), ("level_negative", 0.5)):
        told = friction["parameters"][name]
        assert abs(told["value"] - true) < 3.0 * told["standard_error"]
    assert [Path(path).name for path in decided["drives_off"]] == ["drives-off.csv"]


def test_a_recording_in_which_the_arm_moves_is_refused(
    motions: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    assert run(["diagnose", *motions, "--arm", str(DDA), "--drives-off", off(tmp_path, way=0.2)]) == 2
    (line,) = [line for line in capsys.readouterr().err.splitlines() if line.startswith("etude: ")]
    assert "drives-off.csv: moves joint" in line and "brakes" in line


def test_motions_are_asked_for_beside_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["diagnose", "--arm", str(DDA), "--drives-off", off(tmp_path)]) == 2
    assert "recordings: there are none" in capsys.readouterr().err
