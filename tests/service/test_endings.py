"""However a process ends, the arm comes to a defined state, files can be read and nothing is left behind."""

from __future__ import annotations

import os
import signal
from pathlib import Path
from typing import Any

import pytest

from driver.recording import read_recording

pytestmark = pytest.mark.timeout(600)


def test_a_daemon_asked_to_end_stops_the_arm_and_closes_its_files(house: Any, start: Any, playing: Any) -> None:
    start("virtual")
    daemon = start("daemon")
    client = playing()
    assert daemon.stop() == 0
    _, told = client.communicate(timeout=60)
    assert client.returncode == 3, told
    session = house.answer("report", "last")
    assert session["state"] == "stopped"
    assert "daemon was asked to end" in session["cause"]
    recording = read_recording(Path(session["directory"]) / session["recordings"][0])
    assert abs(recording.dq[-20:]).max() < 0.1
    assert sorted(p.suffix for p in (house.folder / "run").iterdir() if p.name.startswith("dda.")) == [".lock"]
    start("daemon")
    assert house.answer("status")["state"] == "idle"


def test_a_killed_daemon_takes_the_loop_along_and_loses_little(house: Any, start: Any, playing: Any) -> None:
    start("virtual")
    daemon = start("daemon")
    client = playing()
    daemon.process.kill()
    _, told = client.communicate(timeout=60)
    assert client.returncode == 4
    assert "went away" in told
    house.wait_until(lambda: len(house.processes()) == 1, "only the stand-in is left")
    start("daemon")
    session = house.answer("report", "last")
    assert session["state"] == "interrupted"
    assert house.answer("status")["state"] == "idle"
    left = next(Path(session["directory"]).glob("*.mcap"))
    assert len(read_recording(left).t) > 100, "recovered by the daemon that came after"


def test_a_stand_in_that_vanishes_stops_the_session_with_its_cause(house: Any, start: Any, playing: Any) -> None:
    standin = start("virtual")
    start("daemon")
    client = playing()
    standin.process.kill()
    _, told = client.communicate(timeout=60)
    assert client.returncode == 3, told
    assert house.answer("status")["state"] == "latched"
    refused = house.etude("run", "dda-identify-1")
    assert refused.returncode in (2, 3)
    assert "Traceback" not in refused.stderr


def test_a_loop_that_dies_ends_the_daemon_with_its_reason(house: Any, start: Any, playing: Any) -> None:
    start("virtual")
    daemon = start("daemon")
    client = playing()
    cyclic = house.process(b"driver.cyclic")
    os.kill(cyclic, signal.SIGKILL)
    _, told = client.communicate(timeout=60)
    assert client.returncode == 3
    assert "signal 9" in told
    assert daemon.process.wait(60) == 3
    assert house.answer("report", "last")["state"] == "stopped"


def test_up_in_wall_clock_time_and_down_by_ctrl_c(house: Any, for_any_machine: Any) -> None:
    config = house.arm_files()
    motion = for_any_machine(config)
    up = house.popen("up", "--virtual", "--arm", str(config))
    assert up.stderr is not None
    assert any("is up" in line for line in up.stderr), up.wait()
    answer = house.answer("run", str(motion), "--arm", "dda")
    recording = read_recording(answer["recording"])
    assert recording.t[-1] > 8.0
    assert abs(recording.period - 0.01) < 1e-4
    up.send_signal(signal.SIGINT)
    up.communicate(timeout=60)
    assert up.returncode == 0
    house.wait_until(lambda: house.processes() == [], "no process is left")
    left = {p.name for p in (house.folder / "run").iterdir()}
    assert left <= {"dda.lock"}


def test_up_says_why_it_cannot_come_up(house: Any, start: Any) -> None:
    start("virtual")
    up = house.etude("up", "--virtual", "--lockstep", "--arm", "dda")
    assert up.returncode == 2
    assert "stand-in" in up.stderr
