"""A friction that is larger one way, hidden behind daemon, bus and drives: no motion tells it from an offset of the
torques, and the session reads the drives while they are off."""

from __future__ import annotations

from pathlib import Path

import pytest

from benchmarks.campaign.campaign import judged
from benchmarks.campaign.finding import in_process
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.scenario import prepare
from benchmarks.campaign.sealing import HELD_OUT
from benchmarks.campaign.wire import brought_up, motion_file
from service.daemon.client import DaemonClient

pytestmark = pytest.mark.timeout(900)


def test_a_recording_with_the_drives_off_refutes_what_stands_for_an_offset() -> None:
    """A spring whose centre is 13 rad away, which had come in beside the offset itself."""
    plan = Plan(16, 34601, "puma600", ("asymmetric_friction",), 1.0, 0.0, 60.0, drives_off_s=30.0)
    result = judged(plan, in_process)
    assert result.right, result.sentence


def test_a_session_reads_the_drives_while_they_are_off_where_that_decides(tmp_path: Path) -> None:
    plan = Plan(86, 34901, "dda", ("asymmetric_friction",), 2.0, 0.0, seconds=24.0)
    prepared = prepare(plan, tmp_path / "arm.urdf")
    (true,) = prepared.truth.causes
    motions = [
        str(motion_file(tmp_path, motion, prepared))
        for name, motion in prepared.playlist.motions.items()
        if not name.startswith(HELD_OUT)
    ]
    with brought_up(prepared, tmp_path) as run, DaemonClient(run, prepared.installation.arm.name) as daemon:
        answer = daemon.call("diagnose", {"motions": motions, "budget": 1}, lambda news: None)
    (read,) = answer["experiments"]
    assert read["motion"] is None
    assert {rival["effect"] for rival in read["between"]} == {"torque_offset", "asymmetric_friction"}
    assert min(read["predicted_gap"], read["gap"]) > 20.0
    (recording,) = answer["drives_off"]
    assert Path(recording).name == "drives-off.mcap"
    assert recording not in answer["recordings"]
    friction, *others = answer["findings"]
    assert (friction["effect"], friction["joint"], friction["status"]) == ("asymmetric_friction", "joint3", "named")
    assert {one["effect"] for one in others} <= {"transport_delay"}
    for name in ("level_positive", "level_negative"):
        told = friction["parameters"][name]
        assert abs(told["value"] - true.parameters[name]) < 3.0 * told["standard_error"]
