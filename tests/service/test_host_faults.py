"""The host's own troubles, with real processes: stopped, killed, out of disk."""

from __future__ import annotations

import os
import resource
import signal
import time
from collections.abc import Iterator
from contextlib import contextmanager
from itertools import pairwise
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from driver.recording import read_recording, recover
from driver.recording import replay as replay_file
from service.daemon.client import DaemonClient

pytestmark = pytest.mark.timeout(600)

MOTION = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.4, 2.55, 1.6], [3.58, 2.69, 1.75]]
duration_s = [1.6, 1.6]
"""
STALL_S = 1.5
LONGEST_GAP_S = 1.0
"""Between two cycles on a machine that is busy with other tests."""
SESSIONS = 8
MOST_GROWN_KB = 1000
"""By one session, by the median of the later ones: a leak grows each time, an allocator's new arena once."""
RECORDER = b"etude-recorder"


@pytest.fixture(scope="module")
def motion(tmp_path_factory: pytest.TempPathFactory) -> Path:
    path: Path = tmp_path_factory.mktemp("motion") / "there-and-back.toml"
    path.write_text(MOTION)
    return path


def begun(house: Any, motion: Path, *options: str) -> Any:
    """A client whose motion is being played."""
    client = house.popen("run", str(motion), "--arm", "dda", *options)
    assert any(line.startswith("playing") for line in client.stderr), client.wait()
    return client


@contextmanager
def no_room_left(pid: int, limit: int) -> Iterator[None]:
    """No file of the process may grow beyond ``limit`` bytes: what a full disk does to it, and to it alone."""
    before = resource.prlimit(pid, resource.RLIMIT_FSIZE)
    resource.prlimit(pid, resource.RLIMIT_FSIZE, (limit, before[1]))
    try:
        yield
    finally:
        resource.prlimit(pid, resource.RLIMIT_FSIZE, before)


def cycles_kept(house: Any) -> int:
    """How many cycles the loop has run, without those that it skipped."""
    with DaemonClient(house.folder / "run", "dda", looks_only=True) as looking:
        status = looking.call("status")
        return int(status["cycles"] - status["missed"])


def last_session(house: Any) -> dict[str, Any]:
    session: dict[str, Any] = house.answer("report", "last", "--arm", "dda")
    return session


def test_processes_stopped_and_continued_lose_nothing(running_house: Any, motion: Path) -> None:
    """SIGSTOP and SIGCONT of the loop, the recorder, the daemon and the stand-in while the arm moves."""
    house = running_house
    client = begun(house, motion)
    for words in (b"driver.cyclic", RECORDER, b"daemon\0", b"virtual\0"):
        pid = house.process(words)
        os.kill(pid, signal.SIGSTOP)
        time.sleep(0.2)
        os.kill(pid, signal.SIGCONT)
    _, told = client.communicate(timeout=100)
    assert client.returncode == 0, told
    session = last_session(house)
    assert session["state"] == "done"
    path = Path(session["directory"]) / session["recordings"][0]
    recording = read_recording(path)
    assert np.diff(recording.t) == pytest.approx(recording.period, rel=1e-6)
    assert np.isfinite(recording.q).all()
    assert replay_file(path).identical


def resident_kb(pid: int) -> int:
    found = next(x for x in Path(f"/proc/{pid}/status").read_text().splitlines() if x.startswith("VmRSS"))
    return int(found.split()[1])


def test_memory_stays_flat_over_sessions(running_house: Any, tmp_path: Path) -> None:
    """Of the loop, the recorder, the daemon and the stand-in, with clients that come, look and go beside them."""
    house = running_house
    short = tmp_path / "short.toml"
    short.write_text(MOTION.replace("[1.6, 1.6]", "[0.6, 0.6]"))
    watched = {words: house.process(words) for words in (b"driver.cyclic", RECORDER, b"daemon\0", b"virtual\0")}
    sizes = []
    for _ in range(SESSIONS):
        with DaemonClient(house.folder / "run", "dda") as daemon:
            assert daemon.call("run", {"motion": str(short)})["samples"] > 1000
        with DaemonClient(house.folder / "run", "dda", looks_only=True) as looking:
            assert looking.call("status")["state"] == "idle"
        sizes.append({words: resident_kb(pid) for words, pid in watched.items()})
    later = sizes[SESSIONS // 3 :]
    grown = {
        words: float(np.median([after[words] - before[words] for before, after in pairwise(later)]))
        for words in watched
    }
    assert max(grown.values()) < MOST_GROWN_KB, grown


def test_a_disk_without_room_ends_the_session_after_the_motion(running_house: Any, motion: Path) -> None:
    """The arm goes on to the motion's end; the session says which file is cut, and what was written is kept."""
    house = running_house
    with no_room_left(house.process(RECORDER), 300_000):
        client = begun(house, motion)
        _, told = client.communicate(timeout=100)
    assert client.returncode == 2, told
    assert "Traceback" not in told
    session = last_session(house)
    assert session["state"] == "failed"
    assert "File too large" in session["cause"]
    assert house.answer("status", "--arm", "dda")["state"] == "idle"
    left = Path(session["directory"]) / session["recordings"][0]
    assert left.stat().st_size <= 300_000
    recover(left)
    assert len(read_recording(left).t) > 100


def test_a_session_that_cannot_keep_its_record_leaves_the_arm_off(running_house: Any, motion: Path) -> None:
    """The disk of the sessions is full before one begins, and from the middle of one on."""
    house = running_house
    daemon = house.process(b"daemon\0")
    with no_room_left(daemon, 100):
        refused = house.etude("run", str(motion), "--arm", "dda")
    assert refused.returncode == 2, refused.stderr
    assert "File too large" in refused.stderr
    client = begun(house, motion)
    with no_room_left(daemon, 100):
        _, told = client.communicate(timeout=100)
        assert client.returncode == 2, told
        assert "File too large" in told
        assert house.answer("status", "--arm", "dda")["state"] == "idle"


def test_a_killed_recorder_costs_one_session_and_no_more(running_house: Any, motion: Path) -> None:
    """The arm goes on to the motion's end; the session says what is kept; a fresh recorder has the next one."""
    house = running_house
    before = house.answer("status", "--arm", "dda")["recorder"]
    assert (before["state"], before["pid"]) == ("ready", house.process(RECORDER))
    client = begun(house, motion)
    # At once: in lockstep a motion takes no longer than its computation, and to ask first may take as long.
    os.kill(before["pid"], signal.SIGKILL)
    _, told = client.communicate(timeout=100)
    assert client.returncode == 2, told
    assert "killed by signal 9" in told
    session = last_session(house)
    assert session["state"] == "failed"
    assert "killed by signal 9" in session["cause"] and "are kept" in session["cause"]
    kept = read_recording(Path(session["directory"]) / session["recordings"][0])
    assert len(kept.t) > 20, "at least the rest before the motion, and readable as it is"
    done = house.answer("run", str(motion), "--arm", "dda")
    assert done["samples"] > 3000
    assert replay_file(Path(done["recording"])).identical
    status = house.answer("status", "--arm", "dda")
    after = status["recorder"]
    assert (status["state"], after["state"], after["restarts"]) == ("idle", "ready", before["restarts"] + 1)
    assert after["pid"] == house.process(RECORDER) != before["pid"]
    assert "killed by signal 9" in after["last_death"]
    assert "a fresh one is ready" in house.etude("status", "--arm", "dda").stdout


def test_a_loop_stopped_on_the_wall_clock_neither_bursts_nor_goes_on(house: Any, start: Any, tmp_path: Path) -> None:
    """Stopped for longer than the drives' patience: they stop by themselves; the loop finds it when it is back."""
    motion = tmp_path / "slow.toml"
    motion.write_text(MOTION.replace("[1.6, 1.6]", "[8, 8]"))
    config = house.arm_files()
    text = config.read_text().replace("rate_hz = 1000", "rate_hz = 200\nmissed_deadlines_to_stop = 60")
    config.write_text(text.replace("heartbeat_ms = 20", "heartbeat_ms = 400"))
    start("virtual", "--config", str(config))
    start("daemon", "--config", str(config))
    client = begun(house, motion)
    cyclic = house.process(b"driver.cyclic")
    began, before = time.monotonic(), cycles_kept(house)
    os.kill(cyclic, signal.SIGSTOP)
    time.sleep(STALL_S)
    os.kill(cyclic, signal.SIGCONT)
    _, told = client.communicate(timeout=100)
    assert client.returncode == 3, told
    cycles, ran_s = cycles_kept(house) - before, time.monotonic() - began - STALL_S
    assert cycles <= 200 * ran_s + 4, "none of the stall's cycles was made up for"
    status = house.answer("status", "--arm", "dda")
    assert status["state"] == "latched"
    assert status["cause"] and status["last_frames"]
    shown = house.etude("status", "--arm", "dda").stdout
    assert "etude reset" in shown and status["last_frames"][-1] in shown
    session = last_session(house)
    assert session["state"] == "stopped"
    assert "etude reset" in session["next"]
    assert Path(session["last_frames"]).read_text().splitlines() == status["last_frames"]
    recording = read_recording(Path(session["directory"]) / session["recordings"][0])
    steps = np.diff(recording.t)
    # Stopped within a cycle, the loop finds the drives at rest in that very cycle, and records no gap.
    assert not np.any((steps > LONGEST_GAP_S) & (steps < STALL_S)), "no cycle within the stall"
    assert steps.min() > 0.4 * 0.005, "no two SYNCs came together"
    assert house.answer("reset", "--arm", "dda")["state"] == "idle"
