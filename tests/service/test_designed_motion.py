"""A motion designed for an installation: a motion file, within the limits, that tells more than the arm's own list."""

from __future__ import annotations

from pathlib import Path

from config import load_installation
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
