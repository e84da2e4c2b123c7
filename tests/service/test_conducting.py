"""However a session ends, its arm is not left moving, and its record says why it ended."""

from __future__ import annotations

import asyncio
from collections.abc import Callable
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import pytest

from config import InputError, load_installation
from driver.cyclic.cycle import LoopState
from service.outcomes import ArmStopped
from service.sessions.conductor import Conductor
from service.sessions.identify_load import IdentifyLoad, IdentifyLoadArguments
from service.sessions.store import SessionStore


class FakeArm:
    """An arm whose loop is in a state, and what was asked of it. ``answers``: whether the loop tells its state."""

    def __init__(self, state: LoopState, *, answers: bool = True, frames: tuple[str, ...] = ()) -> None:
        self.asked: list[str] = []
        self.loop = SimpleNamespace(alive=True, status=self._status)
        self._state, self._answers, self._frames = state, answers, frames

    def _status(self) -> Any:
        if not self._answers:
            raise InputError("cyclic loop", "has not answered status within 5 s", "see its log")
        return SimpleNamespace(state=self._state, cause=None, last_frames=self._frames)

    async def disable(self) -> None:
        self.asked.append("disable")

    async def stop(self, cause: str) -> None:
        self.asked.append("stop")


class Ending:
    """A procedure that ends with this exception."""

    kind = "run"

    def __init__(self, error: Exception, meanwhile: Callable[[], None] = lambda: None) -> None:
        self._error, self._meanwhile = error, meanwhile

    def arguments(self) -> dict[str, Any]:
        return {}

    async def perform(self, *_: Any) -> dict[str, Any]:
        self._meanwhile()
        raise self._error


def conducted(arm: FakeArm, procedure: Ending, state: Path) -> Any:
    """The session, once it has ended as the procedure made it end."""

    async def told() -> Any:
        conductor = Conductor(arm, SessionStore(state, "dda"))  # type: ignore[arg-type]
        running = conductor.start(procedure, attached=False, uid=0)  # type: ignore[arg-type]
        await asyncio.wait([running.work])
        assert running.work.exception() is not None
        return running.session

    return asyncio.run(told())


FAULT = InputError("recorder", "its process is gone", "restart the daemon")


@pytest.mark.parametrize(
    ("state", "asked"),
    [
        (LoopState.HOLDING, ["disable"]),
        (LoopState.PLAYING, ["stop"]),
        (LoopState.ENABLING, ["stop"]),
        (LoopState.IDLE, []),
        (LoopState.LATCHED, []),
    ],
)
@pytest.mark.parametrize("error", [FAULT, ZeroDivisionError("a defect")])
def test_the_arm_is_never_left_moving(state: LoopState, asked: list[str], error: Exception, tmp_path: Path) -> None:
    arm = FakeArm(state)
    session = conducted(arm, Ending(error), tmp_path)
    assert arm.asked == asked
    assert session.record.state == "failed"
    assert str(error) in session.record.cause


def test_a_loop_that_does_not_answer_is_told_to_stop(tmp_path: Path) -> None:
    arm = FakeArm(LoopState.PLAYING, answers=False)
    conducted(arm, Ending(InputError("cyclic loop", "has not answered")), tmp_path)
    assert arm.asked == ["stop"]


class Working(Ending):
    """A procedure at work for that long before it ends with the exception."""

    def __init__(self, seconds: float, error: Exception) -> None:
        super().__init__(error)
        self._seconds = seconds

    async def perform(self, *_: Any) -> dict[str, Any]:
        await asyncio.sleep(self._seconds)
        raise self._error


@pytest.mark.parametrize(
    ("seconds", "state", "cause"),
    [(0.05, "stopped", "killed by signal 9"), (3600.0, "interrupted", "has not answered")],
    ids=["that notices by itself", "that estimates for long"],
)
def test_a_daemon_whose_loop_died_ends_its_session(seconds: float, state: str, cause: str, tmp_path: Path) -> None:
    arm = FakeArm(LoopState.PLAYING, answers=False)
    arm.loop.alive = False
    killed = InputError("cyclic loop", "was killed by signal 9", "start again")

    async def told() -> Any:
        conductor = Conductor(arm, SessionStore(tmp_path, "dda"))  # type: ignore[arg-type]
        running = conductor.start(Working(seconds, killed), attached=False, uid=0)  # type: ignore[arg-type]
        await asyncio.sleep(0)
        await conductor.end("the daemon was asked to end")
        assert isinstance(running.work.exception(), ArmStopped)
        return running.session

    session = asyncio.run(told())
    assert session.record.state == state
    assert cause in session.record.cause


def test_a_stop_keeps_its_last_frames(tmp_path: Path) -> None:
    arm = FakeArm(LoopState.LATCHED, frames=("1.0 can0 sent 080", "1.1 can0 received 181 27 02"))
    session = conducted(arm, Ending(ArmStopped("joint1: over-voltage")), tmp_path)
    assert (session.record.state, session.record.cause) == ("stopped", "joint1: over-voltage")
    assert session.last_frames.read_text() == "1.0 can0 sent 080\n1.1 can0 received 181 27 02\n"


def test_an_ending_that_cannot_be_kept_is_told_all_the_same(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _text: str) -> None:
        raise OSError(28, "No space left on device")

    store = SessionStore(tmp_path, "dda")
    session = conducted(
        FakeArm(LoopState.HOLDING),
        Ending(FAULT, lambda: monkeypatch.setattr("service.sessions.store.write_atomically", full)),
        tmp_path,
    )
    assert session.record.state == "failed"
    monkeypatch.undo()
    assert store.open(session.id).record.state == "running"
    assert store.end_abandoned() == [session.id]
    assert store.open(session.id).record.state == "interrupted"


def test_a_session_that_cannot_begin_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def full(_path: Path, _text: str) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("service.sessions.store.write_atomically", full)
    store = SessionStore(tmp_path, "dda")
    with pytest.raises(InputError, match="No space left"):
        store.create("run", {}, attached=False, uid=0)
    assert list(store.directory.iterdir()) == []


def test_a_spoilt_record_hides_no_other(tmp_path: Path) -> None:
    store = SessionStore(tmp_path, "dda")
    sessions = [store.create("run", {}, attached=False, uid=0) for _ in range(3)]
    (sessions[1].directory / "session.json").write_text("{")
    assert store.end_abandoned() == [sessions[0].id, sessions[2].id]


@pytest.mark.parametrize("role", ["library", "expect", "hand"])
def test_files_of_loads_are_read_before_anything_moves(role: str, tmp_path: Path) -> None:
    wrong = tmp_path / "loads.toml"
    wrong.write_text('format = 1\nkind = "loads"\n[[load]]\nname = "block"\nmass = "two"\ncentre = [0, 0, 0]\n')
    with pytest.raises(InputError, match=r"loads\.toml: load\.0\.mass"):
        IdentifyLoad(load_installation("dda"), IdentifyLoadArguments.model_validate({role: wrong}))
