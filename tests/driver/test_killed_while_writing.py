"""A process killed at any of its writes leaves sessions, recordings and models that the next one goes on with.

The child keeps a session as the daemon does; the interpreter tells it of every call that reaches the file system,
and before or after the chosen one it is gone (SIGKILL, which no code can see coming).
"""

from __future__ import annotations

import os
import random
import signal
import sys
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Any

import pytest

from config import InputError, Installation
from config.loader import HERE
from driver.cyclic.cycle import Cycle
from driver.recording import read_recording, recover
from driver.recording.run_writer import RunWriter
from estimator import load_rigid_body
from estimator.arm_model import ArmModel
from service.models.model_file import ModelFile, model_file, read_model
from service.models.store import keep_model, named_model, next_version
from service.sessions.store import SessionStore

pytestmark = pytest.mark.timeout(900)
POINTS = None if os.environ.get("ETUDE_FAULTS") == "full" else 14
"""How many places to die at; None: each one."""
TOUCHES_FILES = frozenset({"write", "flush", "close", "fsync", "open", "replace", "rename", "link", "unlink", "mkdir",
                           "rmdir", "ftruncate", "truncate", "chmod", "flock"})  # fmt: skip
CYCLES = 150
LOST_S = 0.1


@pytest.fixture(scope="module")
def model() -> Callable[[], ModelFile]:
    body = load_rigid_body(HERE / "arms" / "dda" / "dda.urdf")
    return lambda: model_file("dda", ArmModel(body, ()), "clean", [], version=next_version("dda"))


def keep_a_session(
    state: Path, installation: Installation, cycles: list[Cycle], made: ModelFile, told: Callable[[bytes], Any]
) -> None:
    """What a daemon writes in one session. ``told`` hears of every cycle that was recorded, and of the model."""
    session = SessionStore(state, "dda").create("run", {"motion": "a"}, attached=False, uid=0)
    session.update(stage="moving to the start", progress=0.1)
    path = session.directory / "a.mcap"
    writer = RunWriter(path, installation, {"motion": "a"})
    session.update(recordings=(path.name,))
    for cycle in cycles:
        writer.write(cycle)
        told(b"c")
    session.update(stage="playing a", progress=0.5)
    writer.finish()
    told(b"f")
    keep_model(made)
    told(b"m")
    session.write_result({"answer": 42})
    session.end("done")
    told(b"d")


def die_at(number: int, *, after: bool, work: Callable[[Callable[[bytes], Any]], None]) -> tuple[bytes, int]:
    """Do ``work`` in a child that dies at the file operation of that number; what it told, and how many it did."""
    reading, writing = os.pipe()
    counting, counted = os.pipe()
    pid = os.fork()
    if pid == 0:
        done, me, kill, end = 0, os.getpid(), os.kill, signal.SIGKILL

        def operation(_frame: FrameType, event: str, argument: Any) -> None:
            nonlocal done
            if event not in ("c_call", "c_return") or getattr(argument, "__name__", "") not in TOUCHES_FILES:
                return
            done += event == "c_call"
            if done == number and event == ("c_return" if after else "c_call"):
                kill(me, end)

        def told(what: bytes) -> None:
            sys.setprofile(None)
            os.write(writing, what)
            sys.setprofile(operation)

        code = 1
        try:
            sys.setprofile(operation)
            work(told)
            sys.setprofile(None)
            os.write(counted, done.to_bytes(4, "little"))
            code = 0
        finally:
            os._exit(code)
    os.close(writing)
    os.close(counted)
    with os.fdopen(reading, "rb") as heard, os.fdopen(counting, "rb") as count:
        said, total = heard.read(), int.from_bytes(count.read(), "little")
    _, status = os.waitpid(pid, 0)
    assert os.WIFSIGNALED(status) or os.WEXITSTATUS(status) == 0, "the child failed otherwise than by being killed"
    return said, total


def check_what_is_left(state: Path, said: bytes, cycles: list[Cycle], made: ModelFile) -> None:
    store = SessionStore(state, "dda")
    store.end_abandoned()
    sessions = list(store.all())
    directories = list(store.directory.glob("*")) if store.directory.is_dir() else []
    assert len(sessions) == len(directories) or not said, "a session with something in it has a record"
    for session in sessions:
        assert session.record.state in ("interrupted", "done")
        assert (session.record.state == "done") >= (b"d" in said)
        if session.record.state == "done":
            assert session.result() == {"answer": 42}
        for name in session.record.recordings:
            check_recording(session.directory / name, said, cycles)
    models = sorted((state / "dda" / "models").glob("[0-9]*.toml"))
    assert len(models) >= (b"m" in said)
    for path in models:
        assert read_model(path) == made
    if models:
        assert named_model("dda") == made


def check_recording(path: Path, said: bytes, cycles: list[Cycle]) -> None:
    recorded = said.count(b"c")
    lasted = (cycles[recorded - 1].time_ns - cycles[0].time_ns) / 1e9 if recorded else 0.0
    try:
        recover(path)
        recording = read_recording(path)
    except InputError:
        assert lasted < LOST_S, "nothing can be read of a recording that had got farther than what may be lost"
        return
    assert recording.t[-1] > lasted - LOST_S
    if b"f" in said:
        assert len(recording.t) == len(cycles)


def test_killed_at_any_write(
    tmp_path: Path, dda: Installation, make_cycles: Any, model: Callable[[], ModelFile], monkeypatch: pytest.MonkeyPatch
) -> None:
    cycles = make_cycles(dda, CYCLES)

    def life(number: int, after: bool) -> int:
        state = tmp_path / f"{number}-{after}"
        monkeypatch.setenv("ETUDE_STATE", str(state))
        made = model()
        said, total = die_at(number, after=after, work=lambda told: keep_a_session(state, dda, cycles, made, told))
        check_what_is_left(state, said, cycles, made)
        # And the next one works on, in the same place.
        keep_a_session(state, dda, cycles[:5], model(), lambda _: None)
        assert [s.record.state for s in SessionStore(state, "dda").all()][-1] == "done"
        assert read_model(state / "dda" / "models" / f"{next_version('dda') - 1:04d}.toml").arm == "dda"
        return total

    total = life(0, False)
    assert total > 60, "each file that is written is opened, written, flushed to the disk, closed and renamed"
    points = [(number, after) for number in range(1, total + 1) for after in (False, True)]
    for number, after in points if POINTS is None else random.Random(3).sample(points, POINTS):
        life(number, after)
