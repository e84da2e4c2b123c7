"""A motion designed for an installation: a motion file, within the limits, that tells more than the arm's own list."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config import InputError, Installation, load_installation
from config.motion import check_motion, load_motion, sample
from service.identification.designed_motion import design_motion


def test_designed_motion_is_a_motion_file_that_tells_more(tmp_path: Path) -> None:
    installation = load_installation("dda")
    report = design_motion(installation, tmp_path / "designed.toml")
    motion = load_motion(str(report.path), installation)
    check_motion(sample(motion, installation.cycle.rate_hz), installation)
    assert report.own_log_determinant is not None
    assert report.own_worst_standard_error is not None
    assert report.log_determinant > report.own_log_determinant + 5.0
    assert report.worst_standard_error < report.own_worst_standard_error
    assert "designed.toml" in report.sentence


def with_floor(name: str, floor_m: float) -> Installation:
    installation = load_installation(name)
    return installation.model_copy(update={"arm": installation.arm.model_copy(update={"floor_m": floor_m})})


def lowest(installation: Installation, poses: np.ndarray) -> float:
    """m, of the joints' origins and the tool, by the URDF alone."""
    model = pin.buildModelFromUrdf(str(installation.path.parent / installation.arm.urdf))
    data = model.createData()
    tool = model.getFrameId(installation.arm.tool_frame)
    found = []
    for pose in poses:
        pin.framesForwardKinematics(model, data, pose)
        found.append(min(*(data.oMi[k].translation[2] for k in range(2, model.njoints)), data.oMf[tool].translation[2]))
    return float(min(found))


def test_no_joint_and_no_tool_goes_below_the_floor(tmp_path: Path) -> None:
    """Not even where the middle of the joints' ranges is below it."""
    installation = with_floor("puma600", -0.3)
    report = design_motion(installation, tmp_path / "designed.toml")
    played = sample(load_motion(str(report.path), installation), installation.cycle.rate_hz)
    check_motion(played, installation)
    assert np.ptp(played.q, axis=0).min() > 0.5
    assert lowest(installation, played.q[::7]) > -0.305
    middle = [np.mean(joint.limits.position_rad) for joint in installation.joint]
    assert lowest(installation, np.array([middle])) < -0.4
    way = np.linspace(installation.arm.home_rad, played.q[0], 50)
    assert lowest(installation, way) >= -0.3


def test_a_home_below_the_floor_is_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"arm\.floor_m: the arm's home is 0\.0438 m below -0\.2 m"):
        design_motion(with_floor("puma600", -0.2), tmp_path / "designed.toml")
    assert not (tmp_path / "designed.toml").exists()
