"""However a process ends, the arm comes to a defined state, files can be read and nothing is left behind."""

from __future__ import annotations

import os
import signal
import subprocess
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from driver.recording import read_recording, recover
from service.supervision import SupervisedProcess

pytestmark = pytest.mark.timeout(180)

SLOW = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.2, 2.4, 1.4], [3.58, 2.69, 1.75]]
duration_s = [8.0, 8.0]
"""


def processes_of(house: Any) -> list[int]:
    """Processes that work in this run directory."""
    marker = f"ETUDE_RUN={house.environment['ETUDE_RUN']}".encode()
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            if int(entry.name) != os.getpid() and marker in (entry / "environ").read_bytes().split(b"\0"):
                found.append(int(entry.name))
        except OSError:
            continue  # it has ended meanwhile, or is not ours to see
    return found


def wait_until(condition: Callable[[], bool], what: str) -> None:
    deadline = time.monotonic() + 60
    while not condition():
        assert time.monotonic() < deadline, f"not within a minute: {what}"
        time.sleep(0.1)


@pytest.fixture
def start(house: Any) -> Iterator[Callable[[str], SupervisedProcess]]:
    """Starts `etude virtual` or `etude daemon` in lockstep, ready; all are ended at last."""
    running: list[SupervisedProcess] = []

    def starting(command: str) -> SupervisedProcess:
        process = SupervisedProcess([command, "--config", "dda", "--lockstep"], house.environment)
        running.append(process)
        process.wait_ready(90)
        return process

    yield starting
    for process in reversed(running):
        process.stop()
    wait_until(lambda: processes_of(house) == [], "no process is left")


@pytest.fixture
def playing(house: Any, tmp_path: Path) -> Callable[[], subprocess.Popen[str]]:
    """Starts a client whose slow motion is being played."""

    def begin() -> subprocess.Popen[str]:
        path = tmp_path / "slow.toml"
        path.write_text(SLOW)
        client: subprocess.Popen[str] = house.popen("run", str(path))
        assert client.stderr is not None
        assert any(line.startswith("playing") for line in client.stderr), client.wait()
        return client

    return begin


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
    wait_until(lambda: len(processes_of(house)) == 1, "only the stand-in is left")
    start("daemon")
    session = house.answer("report", "last")
    assert session["state"] == "interrupted"
    assert house.answer("status")["state"] == "idle"
    left = next(Path(session["directory"]).glob("*.mcap"))
    recover(left)
    assert len(read_recording(left).t) > 100


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
    cyclic = [pid for pid in processes_of(house) if b"driver.cyclic" in Path(f"/proc/{pid}/cmdline").read_bytes()]
    assert len(cyclic) == 1
    os.kill(cyclic[0], signal.SIGKILL)
    _, told = client.communicate(timeout=60)
    assert client.returncode == 3
    assert "signal 9" in told
    assert daemon.process.wait(60) == 3
    assert house.answer("report", "last")["state"] == "stopped"


def test_up_in_wall_clock_time_and_down_by_ctrl_c(house: Any) -> None:
    config = house.arm_files()
    text = config.read_text().replace("rate_hz = 1000", "rate_hz = 200\nmissed_deadlines_to_stop = 60")
    # Slow enough that the load of the machine that runs the tests decides nothing.
    config.write_text(text.replace("heartbeat_ms = 20", "heartbeat_ms = 400"))
    up = house.popen("up", "--virtual", "--arm", str(config))
    assert up.stderr is not None
    assert any("is up" in line for line in up.stderr), up.wait()
    answer = house.answer("run", "dda-identify-2", "--arm", "dda")
    recording = read_recording(answer["recording"])
    assert recording.t[-1] > 1.3
    assert abs(recording.period - 0.005) < 1e-4
    up.send_signal(signal.SIGINT)
    up.communicate(timeout=60)
    assert up.returncode == 0
    wait_until(lambda: processes_of(house) == [], "no process is left")
    left = {p.name for p in (house.folder / "run").iterdir()}
    assert left <= {"dda.lock"}


def test_up_says_why_it_cannot_come_up(house: Any, start: Any) -> None:
    start("virtual")
    up = house.etude("up", "--virtual", "--lockstep", "--arm", "dda")
    assert up.returncode == 2
    assert "stand-in" in up.stderr
