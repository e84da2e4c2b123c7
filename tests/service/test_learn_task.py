"""Tasks learnt by a few parameters, through the stand-in arm: a point hit at a time, an unknown payload carried."""

from __future__ import annotations

import math
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pinocchio as pin
import pytest

from config import InputError, load_installation
from learner.kinematics import Kinematics
from learner.tool_point import ToolPoint
from learner.trial import Trial
from service import outcomes
from service.practice.carrying import Carrying
from service.practice.course import FLAT_HZ
from service.practice.inverse_models import load_inverse_model
from service.practice.task_file import load_task
from service.reports import pages

pytestmark = pytest.mark.timeout(600)
HIT = """
kind = "hit"
start_rad = [1.5, 3.5, 2.0]
end_rad = [4.0, 1.8, 0.3]
point_m = [0.3, 0.25, 1.2]
at_s = 0.5
duration_s = 1.1
"""
CARRY = """
kind = "carry"
motion = "swing.toml"
"""
SWING = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.0, 2.0, 0.6], [3.58, 2.69, 1.75]]
duration_s = [0.8, 0.8]
"""


@pytest.fixture
def hit(tmp_path: Path) -> Path:
    path = tmp_path / "hit.toml"
    path.write_text(HIT)
    return path


def test_a_point_is_hit_at_a_time(running_house: Any, hit: Path) -> None:
    answer = running_house.answer("practise", "--task", str(hit), "--trials", "2")
    misses = [math.hypot(*trial["miss"].values()) for trial in answer["trials"]]
    assert misses[0] > 1e-3
    assert misses[-1] < 0.1 * misses[0]
    assert misses[1] < 0.3 * misses[0]
    tool = ToolPoint(load_inverse_model(None, load_installation("dda")).model.body, "tool")
    aim = np.array(list(answer["trials"][0]["parameters"].values()))
    np.testing.assert_allclose(tool.at(aim), [0.3, 0.25, 1.2], atol=1e-6)
    report = running_house.answer("report", "last")
    page = pages.page_of(report["result"], Path(report["directory"]))
    assert page is not None
    assert "aim_joint1" in page
    assert "aim_joint1" in running_house.etude("report", "last").stdout


def test_what_the_plan_of_a_payload_lacks_is_put_into_it(running_house: Any, tmp_path: Path) -> None:
    """The last link is heavier than its URDF says: what is added at the tool is what the servo need not add then."""
    (tmp_path / "swing.toml").write_text(SWING)
    (tmp_path / "carry.toml").write_text(CARRY)
    answer = running_house.answer("practise", "--task", str(tmp_path / "carry.toml"), "--trials", "2")
    first, last = answer["trials"][0]["miss"], answer["trials"][-1]["miss"]
    assert abs(first["mass"]) > 10.0 * answer["scatter"]["mass"]
    assert abs(last["mass"]) < 0.2 * abs(first["mass"])
    assert answer["trials"][1]["parameters"]["mass"] == pytest.approx(first["mass"])


def test_a_payload_is_read_off_the_torques() -> None:
    """The block of Table 3.1, 47 mm outside the tool's frame; its torques by pinocchio, with the block in the link."""
    installation = load_installation("dda")
    model = load_inverse_model(None, installation)
    carrying = Carrying("carry", "dda-load", installation, "csp", model)
    body = model.model.body
    mass, centre = 1.106, np.array([0.001, 0.0, 0.047])
    tool = body.model.frames[body.model.getFrameId("tool")].placement
    loaded = body.model.copy()
    loaded.inertias[3] = loaded.inertias[3] + pin.Inertia(mass, tool.act(centre), np.zeros((3, 3)))
    heavy = replace(model, model=replace(model.model, body=replace(body, model=loaded)))
    practised = carrying.practised(carrying.start)
    r = practised.reference
    done = Kinematics(r.period, held=True, flat_hz=FLAT_HZ).at_torques(r.q, r.dq)
    noise = np.random.default_rng(2).normal(0.0, 0.05, r.q.shape)
    found = carrying.outcome(Trial(r.q, r.dq, heavy.torque(*done) + noise), carrying.start)
    np.testing.assert_allclose(found, [mass, *(mass * centre)], atol=0.02)
    left = carrying.outcome(Trial(r.q, r.dq, heavy.torque(*done) + noise), found)
    np.testing.assert_allclose(left, 0.0, atol=1e-3)


def test_what_a_task_file_gets_wrong_is_named(hit: Path, house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    from service.cli.entry import run

    installation = load_installation("dda")
    for was, is_now, said in (
        ("at_s = 0.5", "at_s = 1.2", "at_s"),
        ("1.5, 3.5, 2.0", "1.5, 3.5", "start_rad"),
        ('"hit"', '"catch"', "choose one of hit, carry"),
        ("at_s", "at", "at"),
    ):
        hit.write_text(HIT.replace(was, is_now))
        with pytest.raises(InputError, match=said):
            load_task(str(hit), installation)
    assert run(["practise"]) == outcomes.BAD_INPUT
    assert run(["practise", "dda-practice", "--task", str(hit)]) == outcomes.BAD_INPUT
    assert run(["practise", "--task", str(hit), "--resume", "x"]) == outcomes.BAD_INPUT
    assert "--resume" in capsys.readouterr().err
