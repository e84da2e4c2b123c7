"""Sessions through the real daemon, loop, recorder and stand-in arm, in lockstep."""

from __future__ import annotations

import re
import signal
import subprocess
import time
from collections.abc import Iterator
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config import InputError, load_installation
from driver.recording import read_recording
from service.daemon.client import DaemonClient

pytestmark = pytest.mark.timeout(600)

SLOW = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.2, 2.4, 1.4], [3.58, 2.69, 1.75]]
duration_s = [8.0, 8.0]
"""
"""Long enough to be interrupted: some seconds of lockstep."""


@pytest.fixture
def arm(running_house: Any) -> Iterator[Any]:
    """The running arm, idle again after each test whatever the test did."""
    yield running_house
    if running_house.answer("status")["state"] == "latched":
        running_house.etude("reset")
    assert running_house.answer("status")["state"] == "idle"


@pytest.fixture
def slow(tmp_path: Path) -> str:
    path = tmp_path / "slow.toml"
    path.write_text(SLOW)
    return str(path)


def daemon_of(house: Any) -> DaemonClient:
    """A connection made at once, where a command would start too slowly."""
    return DaemonClient(house.folder / "run", "dda")


def until_playing(client: subprocess.Popen[str]) -> None:
    """Read the client's progress up to the stage in which the motion is played."""
    assert client.stderr is not None
    told = ""
    for line in client.stderr:
        if line.startswith("playing"):
            return
        told += line
    pytest.fail(f"the client ended before its motion was played, with code {client.wait()}: {told}")


def ended(house: Any) -> dict[str, Any]:
    """The newest session, once it is over."""
    deadline = time.monotonic() + 100
    while time.monotonic() < deadline:
        session: dict[str, Any] = house.answer("report", "last")
        if session["state"] != "running":
            return session
        time.sleep(0.2)
    pytest.fail("the session did not end")


def test_a_motion_is_played_recorded_replayed_and_reported(arm: Any) -> None:
    answer = arm.answer("run", "dda-identify-1")
    assert set(answer["tracking_error"]) == {"joint1", "joint2", "joint3"}
    assert max(e["position_peak"] for e in answer["tracking_error"].values()) < np.deg2rad(5)
    recording = read_recording(answer["recording"])
    travel = np.ptp(recording.q, axis=0)
    np.testing.assert_allclose(travel, np.deg2rad([250, 250, 240]), atol=np.deg2rad(4))
    assert arm.answer("replay", answer["recording"])["identical"] is True
    report = arm.answer("report", answer["session"])
    assert report["state"] == "done"
    assert report["result"]["tracking_error"] == answer["tracking_error"]
    listed = {r["path"]: r for r in arm.answer("recordings")["recordings"]}
    assert listed[answer["recording"]]["samples"] == answer["samples"]


def test_torque_mode_follows_by_the_loops_own_controller(arm: Any) -> None:
    answer = arm.answer("run", "dda-controllers", "--mode", "cst", "--controller", "computed_torque")
    assert max(e["position_peak"] for e in answer["tracking_error"].values()) < np.deg2rad(8)
    refused = arm.etude("run", "dda-controllers", "--controller", "computed_torque")
    assert refused.returncode == 2
    assert "--mode cst" in refused.stderr


def test_links_are_identified_by_moving_and_again_from_the_recordings(arm: Any, tmp_path: Path) -> None:
    moved = arm.answer("identify", "links")
    assert moved["status"] == "identified"
    assert len(moved["base_parameters"]) == 15
    assert {"samples", "identifiability", "torque_residual", "hold_out", "model"} <= set(moved)
    assert moved["relative_error"] < 3.0
    files = moved["recordings"]
    again = arm.answer("identify", "links", *files, "--out", str(tmp_path / "again"))
    assert again["base_parameters"] == moved["base_parameters"]
    csv = []
    for k, file in enumerate(files):
        csv.append(str(tmp_path / f"{k}.csv"))
        arm.answer("export", file, csv[-1])
    foreign = arm.answer("identify", "links", *csv, "--arm", "dda", "--out", str(tmp_path / "csv"))
    for ours, theirs in zip(moved["base_parameters"], foreign["base_parameters"], strict=True):
        assert theirs["value"] == pytest.approx(ours["value"], abs=0.5 * ours["standard_error"])


def test_a_cut_recording_is_refused_then_recovered(arm: Any, tmp_path: Path) -> None:
    answer = arm.answer("run", "dda-identify-3")
    whole = Path(answer["recording"]).read_bytes()
    cut = tmp_path / "cut.mcap"
    cut.write_bytes(whole[: int(0.8 * len(whole))])
    refused = arm.etude("identify", "links", str(cut), "--arm", "dda")
    assert refused.returncode == 2
    assert "etude recover" in refused.stderr
    assert cut.read_bytes() == whole[: int(0.8 * len(whole))]
    report = arm.answer("recover", str(cut))
    assert report["messages"] > 1000
    assert len(read_recording(cut).t) > 0.6 * answer["samples"]


@pytest.mark.parametrize(
    ("change", "said"),
    [
        ("way_points_rad = [[3.58, 2.69, 1.75], [9.0, 2.4, 1.4]]\nduration_s = [30.0]", "joint1 reaches 9 rad"),
        (
            "way_points_rad = [[3.58, 2.69, 1.75], [1.2, 2.4, 1.4]]\nduration_s = [0.3]",
            "joint1.*(velocity|acceleration)",
        ),
        ("way_points_rad = [[3.58, 2.69], [3.2, 2.4]]\nduration_s = [30.0]", "2 values for 3 joints"),
        ("way_points_rad = [[3.58, 2.69, 1.75], [3.2, 2.4, 1.4]]\nduraton_s = [30.0]", "duraton_s.*duration_s"),
    ],
    ids=["position", "too-fast", "joints", "typo"],
)
def test_an_unfit_motion_moves_nothing(change: str, said: str, arm: Any, tmp_path: Path) -> None:
    path = tmp_path / "unfit.toml"
    path.write_text(f'kind = "polynomial"\n{change}\n')
    before = arm.answer("status")
    refused = arm.etude("run", str(path))
    assert refused.returncode == 2
    sentences = [line for line in refused.stderr.splitlines() if line.startswith("etude: ")]
    assert len(sentences) == 1
    assert re.search(said, sentences[0]), sentences[0]
    after = arm.answer("status")
    assert after["cycles"] == before["cycles"]
    assert (after["session"] or {}).get("id") == (before["session"] or {}).get("id")


def test_a_session_outlives_its_client(arm: Any, slow: str) -> None:
    client = arm.popen("run", slow)
    until_playing(client)
    client.kill()
    client.wait()
    session = ended(arm)
    assert (session["state"], session["result"]["motion"]) == ("done", "slow")


def test_leaving_by_ctrl_c_says_what_becomes_of_the_session(arm: Any, slow: str) -> None:
    client = arm.popen("run", slow)
    until_playing(client)
    client.send_signal(signal.SIGINT)
    _, told = client.communicate(timeout=60)
    assert client.returncode == 130
    assert "carries on" in told
    assert ended(arm)["state"] == "done"


def test_an_attached_session_ends_safely_with_its_client(arm: Any, slow: str) -> None:
    client = arm.popen("run", slow, "--attached")
    until_playing(client)
    client.kill()
    client.wait()
    session = ended(arm)
    assert session["state"] == "stopped"
    assert "client" in session["cause"]
    status = arm.answer("status")
    assert status["state"] == "latched"
    assert set(status["drive_states"]) == {"switch on disabled"}
    recording = read_recording(Path(session["directory"]) / session["recordings"][0])
    assert np.nanmax(np.abs(recording.dq[-10:])) < 0.1, "it came to rest before its drives were switched off"
    refused = arm.etude("run", "dda-identify-1")
    assert refused.returncode == 2
    assert "reset" in refused.stderr
    assert arm.answer("reset")["state"] == "idle"
    assert arm.answer("run", "dda-identify-1")["motion"] == "dda-identify-1"


def test_stop_ends_the_session_of_another_client(arm: Any, slow: str) -> None:
    client = arm.popen("run", slow)
    until_playing(client)
    with daemon_of(arm) as daemon:
        assert daemon.call("stop")["state"] == "latched"
    _, told = client.communicate(timeout=60)
    assert client.returncode == 3
    assert "stopped on request of user" in told
    assert ended(arm)["state"] == "stopped"


def test_a_busy_arm_takes_no_second_session(arm: Any, slow: str) -> None:
    client = arm.popen("run", slow)
    until_playing(client)
    with daemon_of(arm) as daemon, pytest.raises(InputError, match="busy"):
        daemon.call("run", {"motion": "dda-identify-1"})
    client.communicate(timeout=100)
    assert client.returncode == 0


def test_a_second_daemon_is_refused(arm: Any) -> None:
    refused = arm.etude("daemon", "--config", "dda", "--lockstep")
    assert refused.returncode == 2
    assert "already serves" in refused.stderr
    refused = arm.etude("virtual", "--config", "dda", "--lockstep")
    assert refused.returncode == 2
    assert refused.stderr.count("etude: ") == 1


def test_a_served_arm_is_sound(arm: Any) -> None:
    answer = arm.answer("check", "--arm", "dda")
    assert answer["verdict"] == "sound"
    drives = [f for f in answer["findings"] if f["subject"] == "drives"]
    assert drives[0]["verdict"] == "ok"


def test_lists_of_joints_agree(arm: Any) -> None:
    status = arm.answer("status")
    assert tuple(status["joints"]) == load_installation("dda").joint_names
    assert len(status["q"]) == len(status["drive_states"]) == 3
