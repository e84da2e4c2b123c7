"""The adaptors of measured recordings: frames that are right, files that the commands read."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest
from scipy.io import loadmat

from benchmarks.measured import ADAPTORS, MeasuredArm, cogging_map, is_here, write_files
from benchmarks.measured.dataset import data_folder
from benchmarks.measured.kinematics import DhRow, JointLimits, turned_about_x, urdf_of_standard_dh
from benchmarks.measured.kuka import LIMITS, START, TABLE
from driver.recording import read_recording
from estimator import Trajectory, load_rigid_body, torque_regressor

LIMIT = JointLimits(-3.0, 3.0, 2.0, 10.0)


def test_frames_of_a_standard_table() -> None:
    """Against the product of the table's transforms, Rot z · Trans z · Trans x · Rot x of each row."""
    random = np.random.default_rng(5)
    rows = [DhRow(*random.normal(size=4)) for _ in range(5)]
    base = turned_about_x(0.7)
    body = load_rigid_body(urdf_of_standard_dh("arm", rows, [LIMIT] * 5, base))
    q = random.normal(size=5)
    frame = np.eye(4)
    frame[:3, :3] = base
    for row, angle in zip(rows, q, strict=True):
        turn = np.eye(4)
        c, s = np.cos(angle + row.offset), np.sin(angle + row.offset)
        turn[:2, :2] = [[c, -s], [s, c]]
        rest = np.eye(4)
        rest[:3, :3], rest[:3, 3] = turned_about_x(row.alpha), (row.a, 0.0, row.d)
        joint = frame @ turn
        frame = joint @ rest
    data = body.model.createData()
    pin.forwardKinematics(body.model, data, body.configuration(q))
    np.testing.assert_allclose(data.oMi[5].homogeneous, joint, atol=1e-12)


def test_files_are_read_as_they_were_written(tmp_path: Path) -> None:
    random = np.random.default_rng(1)
    t = np.arange(50) / 100.0
    q, tau = random.normal(size=(2, 50, 1))
    tau[7] = np.nan
    arm = MeasuredArm(
        "arm", urdf_of_standard_dh("arm", [DhRow(0, 0, 0)], [LIMIT]), {"motion": Trajectory(t, q, tau)}, ()
    )
    urdf, csv = write_files(arm, tmp_path)
    recording = read_recording(csv)
    assert load_rigid_body(urdf).joints == recording.joints == ("joint1",)
    whole = np.arange(50) != 7
    np.testing.assert_allclose(recording.t, t[whole], rtol=1e-11)
    np.testing.assert_allclose(recording.q, q[whole], rtol=1e-11)
    assert recording.tau is not None
    np.testing.assert_allclose(recording.tau, tau[whole], rtol=1e-11)
    assert recording.dq is None


@pytest.mark.parametrize("folder", ADAPTORS)
def test_every_data_set_fits_its_arm(folder: str) -> None:
    if not is_here(folder):
        pytest.skip(f"{folder} is not in ../shared/data")
    arm = ADAPTORS[folder]()
    body = arm.body
    assert [*arm.training, *arm.judging]
    for trajectory in arm.recordings.values():
        assert trajectory.q.shape[1] == body.n
        assert np.isfinite(trajectory.tau).mean() > 0.999
        # Over a tenth of a second noise counts for nothing: the joints keep to their speeds, in rad/s and m/s.
        steps = round(0.1 * trajectory.rate)
        way = trajectory.q[steps:] - trajectory.q[:-steps]
        speed = way / (trajectory.t[steps:] - trajectory.t[:-steps])[:, None]
        assert np.all(np.abs(speed) < body.model.velocityLimit)


def test_kuka_frames_give_the_mass_matrix_that_its_recordings_carry() -> None:
    """The authors stored the diagonal of the mass matrix and the gravity torques of their own model along the motion:
    in the right frames they are linear in ten parameters a link, in others they are not."""
    if not is_here("kuka_kr300"):
        pytest.skip("kuka_kr300 is not in ../shared/data")
    assert share_unexplained(START) < 0.01
    assert share_unexplained(np.zeros(6)) > 0.2


def share_unexplained(start: np.ndarray) -> float:
    text = urdf_of_standard_dh("kuka", TABLE, LIMITS, turned_about_x(np.pi))
    body, weightless = load_rigid_body(text), load_rigid_body(text, gravity=(0.0, 0.0, 0.0))
    rows, right = [], []
    for letter in "ABC":
        content = loadmat(data_folder("kuka_kr300") / f"recorded_{letter}.mat", squeeze_me=True, struct_as_record=False)
        q = start + content["ref_kin"].phi_r_all[::20]
        rest = np.zeros_like(q)
        gravity = torque_regressor(body, q, rest, rest)
        rows.append((gravity - gravity[0]).reshape(-1, 60))
        right.append(content["tau_g_all"].T[::20].ravel())
        for joint in range(6):
            unit = rest.copy()
            unit[:, joint] = 1.0
            inertia = torque_regressor(weightless, q, rest, unit)[:, joint]
            rows.append(inertia - inertia[0])
            right.append(content["m_all"][joint, ::20] - content["m_all"][joint, 0])
    matrix, target = np.concatenate(rows), np.concatenate(right)
    parameters = np.linalg.lstsq(matrix, target, rcond=1e-9)[0]
    return float(np.linalg.norm(target - matrix @ parameters) / np.linalg.norm(target))


def test_cogging_map_leaves_out_what_was_not_measured() -> None:
    if not is_here("odrive_cogging"):
        pytest.skip("odrive_cogging is not in ../shared/data")
    angle, current = cogging_map("a_16")
    assert len(angle) < 8192
    assert np.all(current != 0.0)
    assert 0.1 < np.std(current) < 1.0
