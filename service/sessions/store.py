"""Where sessions live: one directory each, its ``session.json`` replaced atomically at every change.

<state>/<arm>/sessions/<id>/session.json      what was asked, how far it came, how it ended
                            *.mcap            the recordings
                            result.json       the answer, once there is one
                            last-frames.txt   what passed on the buses just before a stop
                            *.toml, *.png     models and plots
"""

from __future__ import annotations

import json
import logging
import os
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from datetime import UTC, datetime
from pathlib import Path
from typing import Any, Literal

from pydantic import BaseModel, ConfigDict, ValidationError

from config import InputError
from driver.recording import recover
from service.answers import finite

log = logging.getLogger(__name__)
LAST_FRAMES = "last-frames.txt"
SessionState = Literal["running", "done", "stopped", "failed", "interrupted"]
Kind = Literal[
    "run",
    "identify-links",
    "identify-load",
    "calibrate-torque-constant",
    "diagnose",
    "practise",
    "learn-task",
    "compare-controllers",
]


class SessionRecord(BaseModel):
    """What ``session.json`` holds. ``progress`` is the share of the whole session, 0 to 1."""

    model_config = ConfigDict(extra="forbid", frozen=True)

    id: str
    kind: Kind
    arm: str
    arguments: dict[str, Any]
    attached: bool
    """Whether the session ends when the client that started it goes away."""
    started_by_uid: int
    started: str
    ended: str | None = None
    state: SessionState = "running"
    stage: str = ""
    progress: float = 0.0
    cause: str | None = None
    """One sentence: why it ended in any state but "done"."""
    recordings: tuple[str, ...] = ()
    """File names in the session's directory, in the order they were played."""


def write_atomically(path: Path, text: str) -> None:
    """Replace ``path`` by ``text``: a reader, or a crash, sees the old file or the new one, whole."""
    with _draft(path, text) as draft:
        draft.replace(path)


def write_once(path: Path, text: str) -> None:
    """Make ``path`` with ``text``: whoever looks, or a crash, finds no file or the whole one. FileExistsError when
    it is there: of two that come at once, one."""
    with _draft(path, text) as draft:
        os.link(draft, path)


@contextmanager
def _draft(path: Path, text: str) -> Iterator[Path]:
    """The text on disk under a name that nobody looks for; removed when it was not renamed."""
    draft = path.with_name(f".{path.name}.{os.getpid()}")
    try:
        with draft.open("w") as file:
            file.write(text)
            file.flush()
            os.fsync(file.fileno())
        yield draft
    finally:
        draft.unlink(missing_ok=True)


class Session:
    """One session's directory and its record."""

    def __init__(self, directory: Path, record: SessionRecord) -> None:
        self.directory = directory
        self.record = record

    @property
    def id(self) -> str:
        return self.record.id

    def update(self, **changes: Any) -> None:
        """Change the record's fields, in memory and on disk. Raises InputError when the disk refuses."""
        self.record = self.record.model_copy(update=changes)
        self._write("session.json", self.record.model_dump_json(indent=1))

    def end(self, state: SessionState, cause: str | None = None) -> None:
        share = 1.0 if state == "done" else self.record.progress
        self.update(state=state, cause=cause, ended=_now(), progress=share)

    def write_result(self, result: dict[str, Any]) -> None:
        """Keep the answer as ``result.json``, NaN and infinity as null."""
        text = json.dumps(finite(result), indent=1, allow_nan=False, ensure_ascii=False)
        self._write("result.json", text)

    def write_last_frames(self, lines: Sequence[str]) -> None:
        """Keep what passed on the buses just before a stop: time in s, bus, direction, identifier and bytes a line."""
        self._write(LAST_FRAMES, "\n".join(lines))

    @property
    def last_frames(self) -> Path | None:
        """The file of `write_last_frames`, where the session has one."""
        path = self.directory / LAST_FRAMES
        return path if path.is_file() else None

    def _write(self, name: str, text: str) -> None:
        path = self.directory / name
        try:
            write_atomically(path, text + "\n")
        except OSError as error:
            raise InputError(str(path), f"cannot be written ({error.strerror})", "free some space") from None

    def result(self) -> dict[str, Any] | None:
        path = self.directory / "result.json"
        if not path.exists():
            return None
        result: dict[str, Any] = json.loads(path.read_text())
        return result


class SessionStore:
    """The sessions of one arm, under ``<state directory>/<arm>/sessions``."""

    def __init__(self, state: Path, arm: str) -> None:
        self.arm = arm
        self.directory = state / arm / "sessions"

    def create(self, kind: Kind, arguments: dict[str, Any], *, attached: bool, uid: int) -> Session:
        """A new running session. Raises InputError when its directory cannot be made."""
        stem = f"{datetime.now(UTC):%Y%m%d-%H%M%S}-{kind}"
        for k in range(1, 1000):
            name = stem if k == 1 else f"{stem}-{k}"
            try:
                (self.directory / name).mkdir(parents=True)
            except FileExistsError:
                continue
            except OSError as error:
                raise InputError(
                    str(self.directory),
                    f"no session can be kept here ({error.strerror})",
                    "set ETUDE_STATE to a writable directory",
                ) from None
            break
        else:
            raise InputError(str(self.directory), f"has a thousand sessions called {stem}", "wait a second")
        record = SessionRecord(
            id=name, kind=kind, arm=self.arm, arguments=arguments, attached=attached, started_by_uid=uid, started=_now()
        )
        session = Session(self.directory / name, record)
        try:
            session.update()
        except InputError:
            session.directory.rmdir()
            raise
        return session

    def open(self, session_id: str) -> Session:
        """The session of that id. Raises InputError naming the newest ones when there is none."""
        path = self.directory / session_id / "session.json"
        if os.sep in session_id or not path.is_file():
            known = [s.id for s in self.all()][-3:]
            raise InputError(
                f"session {session_id}",
                f"arm {self.arm} has no such session",
                f"the newest are {', '.join(known)}" if known else "there is none yet",
            )
        try:
            return Session(path.parent, SessionRecord.model_validate_json(path.read_text()))
        except ValidationError as error:
            raise InputError(str(path), f"is not a session's record ({error.errors()[0]['msg']})") from None

    def all(self) -> Iterator[Session]:
        """Every readable session, oldest first; a record that cannot be read is logged, and hides no other."""
        if not self.directory.is_dir():
            return
        for path in sorted(self.directory.glob("*/session.json"), key=lambda p: (p.stat().st_mtime_ns, p)):
            try:
                yield self.open(path.parent.name)
            except InputError as problem:
                log.warning("left out: %s", problem)

    def end_abandoned(self) -> list[str]:
        """Make readable what sessions had recorded that a daemon left running when it died, and mark them as
        interrupted; returns their ids. Needs the arm's lock."""
        abandoned = [s for s in self.all() if s.record.state == "running"]
        for session in abandoned:
            # Also those that were begun and not yet listed. Only then the mark: whoever dies here is followed too.
            for path in sorted(session.directory.glob("*.mcap")):
                try:
                    log.info("%s", recover(path).sentence)
                except InputError as problem:
                    log.warning("not recovered: %s", problem)
            session.end("interrupted", "the daemon ended before the session did")
        return [s.id for s in abandoned]


def _now() -> str:
    return datetime.now(UTC).isoformat(timespec="milliseconds")
