"""`etude diagnose` with recordings that cannot be this arm's: it says so in one sentence, and names no friction."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from config.loader import HERE
from estimator import Trajectory, inverse_dynamics, load_rigid_body
from estimator.plausibility import without_unusable_torques
from service.cli.entry import run
from service.diagnosis.usable import only_usable

DDA = HERE / "arms" / "dda" / "dda.urdf"
Array = NDArray[np.float64]


@pytest.fixture(autouse=True)
def _state(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))


def motion(seconds: float = 8.0) -> tuple[Array, Array, Array]:
    """t, q and tau of the direct drive arm, with some noise."""
    random = np.random.default_rng(3)
    body = load_rigid_body(DDA)
    t = np.arange(0.0, seconds, 0.004)
    w = 2 * np.pi * np.array([[0.31, 0.47, 0.61], [0.83, 0.71, 1.07]])
    a = np.array([[0.8, 0.7, 0.9], [0.25, 0.3, 0.35]])
    phase = t[:, None, None] * w
    q = np.sum(a * np.sin(phase), axis=1) + [3.5, 2.7, 1.7]
    dq, ddq = np.sum(a * w * np.cos(phase), axis=1), np.sum(-a * w**2 * np.sin(phase), axis=1)
    tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
    return t, q + random.normal(0.0, 2e-5, q.shape), tau + random.normal(0.0, 0.3, tau.shape)


def told(
    tmp_path: Path,
    capsys: pytest.CaptureFixture[str],
    t: Array,
    q: Array,
    tau: Array,
    beside: tuple[str, ...] = (),
) -> str:
    """The one sentence, exit code 2, that the command ends with."""
    path = tmp_path / "recorded.csv"
    joints = load_rigid_body(DDA).joints
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "tau") for joint in joints)])
    np.savetxt(path, np.column_stack([t, q, tau]), delimiter=",", header=header, comments="", fmt="%.9g")
    assert run(["diagnose", str(path), *beside, "--arm", str(DDA), "--json", str(tmp_path / "answer.json")]) == 2
    shown = capsys.readouterr()
    assert shown.out == ""
    lines = [line for line in shown.err.strip().splitlines() if line.startswith("etude: ")]
    assert len(lines) == 1, shown.err
    assert "friction" not in lines[0]
    assert "Traceback" not in shown.err
    assert not (tmp_path / "answer.json").exists()
    return lines[0]


@pytest.mark.parametrize("scale", [1000.0, 0.001], ids=["mN·m", "kN·m"])
def test_torques_in_the_wrong_unit(scale: float, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    assert "torque" in told(tmp_path, capsys, t, q, scale * tau)


@pytest.mark.parametrize("joints", [[0, 1, 2], [1]], ids=["all", "one"])
def test_torques_of_the_wrong_sign(joints: list[int], tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    tau[:, joints] *= -1.0
    assert "sign" in told(tmp_path, capsys, t, q, tau)


def test_swapped_channels(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    assert "out of order" in told(tmp_path, capsys, t, q[:, [1, 0, 2]], tau[:, [1, 0, 2]])


def test_too_short_a_recording(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion(0.3)
    assert "seconds" in told(tmp_path, capsys, t, q, tau)


def test_a_recording_in_which_nothing_moves(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    still = np.repeat(q[:1], len(t), axis=0) + np.random.default_rng(0).normal(0.0, 2e-5, q.shape)
    assert "no joint moves" in told(tmp_path, capsys, t, still, tau)


def test_torques_that_never_change(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    assert "no torque ever changes" in told(tmp_path, capsys, t, q, 0.0 * tau)


def test_the_one_recording_in_another_unit_is_named(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    right = tmp_path / "right.csv"
    joints = load_rigid_body(DDA).joints
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "tau") for joint in joints)])
    np.savetxt(right, np.column_stack([t, q + 1e-5, tau + 0.1]), delimiter=",", header=header, comments="")
    line = told(tmp_path, capsys, t, q, 1000.0 * tau, beside=(str(right),))
    assert line.startswith("etude: recorded.csv: the torques are")
    line = told(tmp_path, capsys, t, q + 1e-5, tau, beside=(str(right), "--hold-out", str(_in_millinewtons(right))))
    assert line.startswith("etude: millinewtons.csv: the torques are")


def _in_millinewtons(right: Path) -> Path:
    table = np.loadtxt(right, delimiter=",", skiprows=1)
    table[:, 4:] *= 1000.0
    path = right.with_name("millinewtons.csv")
    np.savetxt(path, table, delimiter=",", header=right.read_text().splitlines()[0], comments="")
    return path


@pytest.fixture
def right(tmp_path: Path) -> Path:
    t, q, tau = motion()
    path = tmp_path / "right.csv"
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "tau") for joint in load_rigid_body(DDA).joints)])
    np.savetxt(path, np.column_stack([t, q, tau]), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def refused(capsys: pytest.CaptureFixture[str], *arguments: object) -> str:
    assert run(["diagnose", *map(str, arguments)]) == 2
    (line,) = capsys.readouterr().err.strip().splitlines()[-1:]
    return line.removeprefix("etude: ")


def test_the_answer_is_not_written_over_a_recording(right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    before = right.read_bytes()
    assert "is one of the recordings" in refused(capsys, right, "--arm", DDA, "--json", right)
    assert right.read_bytes() == before


def test_a_place_for_the_results_is_looked_at_first(right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, right.with_name("missing.csv"), "--arm", DDA, "--out", right / "results")
    assert line.startswith(f"--out {right / 'results'}: {right} is no directory")


def test_what_is_no_description_of_an_arm(right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    assert "is no installation file" in refused(capsys, right, "--arm", right)
    assert "expand it: xacro" in refused(capsys, right, "--arm", right.with_name("arm.xacro"))


def test_a_joint_that_is_held_where_it_was_recorded_elsewhere(right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    line = refused(capsys, right, "--arm", DDA, "--hold", "joint1=0")
    assert line.startswith("--hold joint1=0: joint1 is in right.csv, up to 4")


def test_recordings_of_other_joints(right: Path, capsys: pytest.CaptureFixture[str]) -> None:
    part = right.with_name("part.csv")
    table, joints = np.loadtxt(right, delimiter=",", skiprows=1), load_rigid_body(DDA).joints[:2]
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "tau") for joint in joints)])
    np.savetxt(part, table[:, [0, 1, 2, 4, 5]], delimiter=",", header=header, comments="")
    assert "has joint3, which part.csv has not" in refused(capsys, part, right, "--arm", DDA)
    assert "joint3 = 0 (--hold JOINT=VALUE)" in refused(capsys, part, "--arm", DDA)


def test_a_torque_that_is_not_measured_has_no_cause(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    t, q, tau = motion()
    tau[:, 1] = 3.0
    assert "joint2 never changes, although the joint moves" in told(tmp_path, capsys, t, q, tau)


def test_what_a_sensor_cuts_off_is_not_looked_at() -> None:
    t, q, tau = motion()
    body = load_rigid_body(DDA)
    (trajectory,), _ = without_unusable_torques(body, [Trajectory(t, q, np.minimum(tau, 0.9 * tau.max(axis=0)))])
    left = only_usable(body, trajectory)
    assert trajectory.unusable is not None
    assert trajectory.unusable.any()
    assert np.array_equal(np.isnan(left.tau), trajectory.unusable)
    (trajectory,), _ = without_unusable_torques(body, [Trajectory(t, q, np.clip(tau, -0.1, 0.1))])
    with pytest.raises(InputError, match="cut off at the end of its range so often"):
        only_usable(body, trajectory)
