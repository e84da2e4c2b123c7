"""A recorder that dies is replaced, and what it had written is kept and told."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Iterator
from pathlib import Path
from typing import Any

import pytest

from config import Installation
from config.errors import InputError
from driver.cyclic.ring import RingWriter
from driver.recording import process, read_recording, recover
from service.sessions import standing_recorder
from service.sessions.standing_recorder import StandingRecorder

CYCLES = 200


@pytest.fixture
def publish(tmp_path: Path, monkeypatch: pytest.MonkeyPatch, dda: Installation, make_cycles: Any) -> Iterator[Any]:
    """Publishes cycles in a ring called t, each time the same number of new ones."""
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path / "run"))
    ring = RingWriter("t", len(dda.joint), period_ns=1_000_000, lockstep=False)
    cycles = iter(make_cycles(dda, 3 * CYCLES))

    def some() -> None:
        for _ in range(CYCLES):
            c = next(cycles)
            values = (*c.q, *c.dq, *c.tau, *c.q_d, *c.dq_d, *c.tau_command, *c.tau_ff)
            frames = [(f.bus, f.sent, f.time_ns, f.data) for f in c.frames]
            ring.publish(c.index, c.time_ns, 0, int(c.state), c.run, 7, values, None, frames, c.serial, c.events)

    yield some
    ring.close()


@pytest.fixture
def recorder(publish: Any, tmp_path: Path, dda: Installation) -> Iterator[StandingRecorder]:
    standing = StandingRecorder(dda, "t", tmp_path)
    yield standing
    standing.close()


def wait_for(what: Callable[[], bool]) -> None:
    deadline = time.monotonic() + 20
    while not what():
        assert time.monotonic() < deadline, "did not happen"
        time.sleep(0.01)


def begin(recorder: StandingRecorder, publish: Callable[[], None], folder: Path) -> Path:
    """A run of which something is on the disk."""
    path = recorder.start_run("motion", folder, {})
    publish()
    copy = folder / "copy.mcap"

    def something_is_there() -> bool:
        copy.write_bytes(path.read_bytes())
        return recover(copy).messages > 0

    wait_for(something_is_there)
    return path


def kill(recorder: StandingRecorder) -> None:
    pid = recorder.report().pid
    assert pid is not None
    os.kill(pid, signal.SIGKILL)
    wait_for(lambda: recorder.report().state == "gone")


def check_next_run(recorder: StandingRecorder, publish: Callable[[], None], folder: Path) -> None:
    path = begin(recorder, publish, folder)
    assert recorder.report().state == "recording"
    assert recorder.stop_run() == path
    assert len(read_recording(path).t) == CYCLES


def test_a_killed_recorder_loses_one_run(recorder: StandingRecorder, publish: Any, tmp_path: Path) -> None:
    first = recorder.report()
    assert (first.state, first.restarts, first.last_death) == ("ready", 0, None)
    path = begin(recorder, publish, tmp_path / "a")
    kill(recorder)
    with pytest.raises(InputError, match=r"was killed by signal 9; the 0\.\d+ s .* of motion\.mcap are kept"):
        recorder.stop_run()
    assert len(read_recording(path).t) > 0
    check_next_run(recorder, publish, tmp_path / "b")
    after = recorder.report()
    assert (after.state, after.restarts) == ("ready", 1)
    assert after.pid != first.pid
    assert after.last_death is not None and "motion.mcap are kept" in after.last_death


def test_the_watch_replaces_it_and_the_run_is_lost_all_the_same(
    recorder: StandingRecorder, publish: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    begin(recorder, publish, tmp_path / "a")
    kill(recorder)
    monkeypatch.setattr(standing_recorder, "PAUSE_S", 1e9)
    recorder.revive_in_time()
    assert recorder.report().state == "gone", "one that has died right after its start is not started over and over"
    monkeypatch.setattr(standing_recorder, "PAUSE_S", 0.0)
    recorder.revive_in_time()
    assert recorder.report().state == "ready"
    with pytest.raises(InputError, match=r"killed by signal 9.*are kept"):
        recorder.stop_run()
    check_next_run(recorder, publish, tmp_path / "b")


def test_between_two_runs_nothing_is_lost(recorder: StandingRecorder, publish: Any, tmp_path: Path) -> None:
    check_next_run(recorder, publish, tmp_path / "a")
    kill(recorder)
    check_next_run(recorder, publish, tmp_path / "b")
    assert recorder.report().last_death == "its process was killed by signal 9"


def test_one_that_does_not_answer_is_replaced(
    recorder: StandingRecorder, publish: Any, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """Its late answer would be taken for that of the next question."""
    path = begin(recorder, publish, tmp_path / "a")
    pid = recorder.report().pid
    assert pid is not None
    os.kill(pid, signal.SIGSTOP)
    with monkeypatch.context() as patched:
        patched.setattr(process, "ANSWER_S", 0.3)
        with pytest.raises(InputError, match=r"had not answered within 0\.3 s and was killed; .* are kept"):
            recorder.stop_run()
    assert len(read_recording(path).t) > 0
    check_next_run(recorder, publish, tmp_path / "b")


def test_where_no_fresh_one_can_be_had_nothing_begins(
    recorder: StandingRecorder, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    kill(recorder)
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path / "elsewhere"))
    with pytest.raises(InputError, match="no loop is running under this name"):
        recorder.revive()
    assert recorder.report().state == "gone"
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path / "run"))
    recorder.revive()
    assert recorder.report().state == "ready"
