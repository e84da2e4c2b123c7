"""`etude diagnose --experiment` through daemon, bus and drives in lockstep: a designed motion decides what was open."""

from __future__ import annotations

import asyncio
import json
import tempfile
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from config import InputError, load_installation
from config.loader import HERE
from config.motion import check_motion, load_motion, sample
from service.sessions.diagnose import DiagnoseArguments, DiagnoseArm, undecided
from service.supervision import SupervisedProcess

pytestmark = pytest.mark.timeout(900)

READY_S = 90.0
FRICTION = """
[[friction]]
joint = "joint2"
level_nm = 0.0
viscous_nms_rad = 0.036
"""
SWING = """
kind = "fourier"
base_hz = 0.5
periods = 2
fade_s = 1.0
centre_rad = [3.5779, 2.6896, 1.7453]
sine_rad = [[0.2, 0.1, 0.2]]
cosine_rad = [[0.0, 0.0, 0.0]]
"""
"""One frequency, one amplitude: it tells that a joint rubs, not by which law."""


@pytest.fixture(scope="module")
def rubbing_arm(new_house: Callable[[Path], Any]) -> Iterator[Any]:
    """The direct drive arm without other mechanics of its own, its second joint rubbing, behind the daemon."""
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        house = new_house(Path(folder))
        hidden = Path(folder) / "rubbing.toml"
        clean = HERE.parent / "virtual_hw" / "hidden" / "dda-clean.toml"
        hidden.write_text(clean.read_text(encoding="utf-8") + FRICTION, encoding="utf-8")
        running = []
        try:
            for command in (["virtual", "--hidden", str(hidden)], ["daemon"]):
                arguments = [command[0], "--config", "dda", "--lockstep", *command[1:]]
                running.append(process := SupervisedProcess(arguments, house.environment))
                process.wait_ready(READY_S)
            yield house
        finally:
            for process in reversed(running):
                process.stop()


def test_what_one_swing_leaves_open_a_designed_motion_decides(rubbing_arm: Any, tmp_path: Path) -> None:
    swing = tmp_path / "swing.toml"
    swing.write_text(SWING, encoding="utf-8")
    asked = ("diagnose", "--experiment", "--motion", str(swing), "--budget", "1", "--track", "dda-load", "--json", "-")
    client = rubbing_arm.popen(*asked)
    out, told = client.communicate(timeout=850)
    assert client.returncode == 0, told
    answer = json.loads(out)
    (played,) = answer["experiments"]
    assert {"effect": "viscous_friction", "joint": "joint2", "other": None, "channel": None} in played["between"]
    assert len(played["between"]) >= 2
    motion = load_motion(played["motion"], load_installation("dda"))
    check_motion(sample(motion, 1000.0), load_installation("dda"))
    assert played["predicted_gap"] > 10.0
    assert played["gap"] > 10.0
    named = {(f["effect"], f["joint"]) for f in answer["findings"] if f["status"] == "named"}
    assert ("viscous_friction", "joint2") in named
    assert len(answer["recordings"]) == 4
    tracking = answer["gain"]["tracking"]
    assert tracking["motion"] == "dda-load"
    assert 0.0 < tracking["position_after_rms"] < tracking["position_before_rms"]
    assert set(tracking["joints"]) == {"joint1", "joint2", "joint3"}
    assert [len(tracking["recordings"][when]) for when in ("before", "after")] == [2, 2]
    page = Path(answer["report"]).read_text(encoding="utf-8")
    assert "position on the arm" in page
    assert json.loads((Path(answer["report"]).parent / "diagnosis.json").read_text())["gain"]["tracking"] == tracking
    kept = rubbing_arm.answer("report", answer["session"])
    assert kept["result"]["verdict"] == answer["verdict"]
    assert Path(kept["page"]).exists()


def test_options_of_experiments_are_refused_without_one(rubbing_arm: Any) -> None:
    refused = rubbing_arm.etude("diagnose", "--budget", "1", "some.mcap")
    assert refused.returncode == 2
    assert "--experiment" in refused.stderr
    refused = rubbing_arm.etude("diagnose", "--track", "dda-load", "some.mcap")
    assert refused.returncode == 2
    assert "--track" in refused.stderr
    refused = rubbing_arm.etude("diagnose", "--experiment", "--track", "nowhere.toml")
    assert refused.returncode == 2
    assert "nowhere.toml" in refused.stderr
    refused = rubbing_arm.etude("diagnose", "--experiment", "--hold", "joint1=0")
    assert refused.returncode == 2
    assert "--hold" in refused.stderr


class Refused:
    """A motion that the found model's feedforward may not play."""

    async def measured(self, *_: object) -> dict[str, Any]:
        raise InputError("dda-load", "asks joint2 for 40 N·m, beyond its limit of 35", "play it slower")


@pytest.mark.parametrize(("model", "said"), [("model.toml", "beyond its limit"), (None, "nothing was found")])
def test_what_was_found_stays_where_its_feedforward_is_not_played(model: str | None, said: str) -> None:
    session = DiagnoseArm(load_installation("dda"), DiagnoseArguments(track="dda-load"))
    answer = {"model": model, "notes": ["before"], "gain": {"tracking": None}}
    following: Any = Refused()
    arm: Any = None
    kept = asyncio.run(session._followed(answer, following, arm, arm, lambda *_: None))
    assert kept["notes"][0] == "before"
    assert said in kept["notes"][1]
    assert kept["gain"] == {"tracking": None}


def test_a_reading_costs_no_motion_and_comes_once() -> None:
    def said(gap: float, motion: str | None) -> dict[str, Any]:
        return {"next_experiment": {"motion": motion, "drives_off_s": 30.0, "predicted_gap": gap}}

    answer = {"findings": [said(9.0, None), said(5.0, "sweep.toml"), {"next_experiment": None}]}
    reading, motion = (finding["next_experiment"] for finding in answer["findings"][:2])
    assert undecided(answer, 1, []) is reading
    assert undecided(answer, 1, [reading]) is motion
    assert undecided(answer, 1, [motion]) is reading
    assert undecided(answer, 1, [reading, motion]) is None
    assert undecided(answer, 0, []) is None
