"""Sessions of a real daemon, killed: one of its processes, or all of them, at a random point of the session.

Each life of the daemon is forked from here, where everything is imported already; its loop and its recorder are the
processes they always are. What is left is looked at when the next life has begun.
"""

from __future__ import annotations

import contextlib
import os
import random
import signal
import threading
import time
from collections import Counter
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError, load_installation
from driver.recording import read_recording
from service.daemon.client import DaemonClient, DaemonDefect
from service.daemon.process import run_daemon
from service.models.model_file import read_model
from service.outcomes import ArmStopped, NoDaemon
from service.practice.record import FILE as PRACTICE_FILE
from service.sessions.store import Session, SessionStore

ARM = "dda"
VICTIMS = ("daemon", "loop", "recorder", "all")
LONGEST_S = 300.0
JITTER_S = 0.15
"""Between a stage's share being told and the kill, at most: what happens between two tidings is hit too."""
ENDED = frozenset({"done", "stopped", "failed", "interrupted"})


class Life:
    """One daemon, from its start to whatever ends it."""

    def __init__(self, run: Path, log: Path) -> None:
        self._run = run
        self.daemon = os.fork()
        if self.daemon == 0:
            _serve(log)
        self._ended = False
        self._wait(self._answers, "the daemon serves")
        with DaemonClient(run, ARM) as client:
            status = client.call("status")
        assert status["state"] in ("idle", "latched"), status["state"]
        self.recorder: int = status["recorder"]["pid"]
        threads = Path(f"/proc/{self.daemon}/task").iterdir()
        children = [pid for thread in threads for pid in (thread / "children").read_text().split()]
        self.loop = next(int(pid) for pid in children if b"driver.cyclic" in _command_line(int(pid)))

    @property
    def alive(self) -> bool:
        if not self._ended:
            self._ended = os.waitpid(self.daemon, os.WNOHANG)[0] != 0
        return not self._ended

    def kill(self, victim: str) -> None:
        """SIGKILL. ``all``: as when the power fails."""
        chosen = {"daemon": [self.daemon], "loop": [self.loop], "recorder": [self.recorder]}
        for pid in chosen.get(victim, [self.daemon, self.loop, self.recorder]):
            with contextlib.suppress(ProcessLookupError):
                os.kill(pid, signal.SIGKILL)
        if victim != "recorder":
            self._wait(lambda: not self.alive, "the daemon has ended")
            self._wait(lambda: not (_runs(self.loop) or _runs(self.recorder)), "its processes have ended")
        else:
            self._wait(lambda: not _runs(self.recorder), "the recorder has ended")

    def end(self) -> None:
        if self.alive:
            os.kill(self.daemon, signal.SIGTERM)
            self._wait(lambda: not self.alive, "the daemon has ended in order")

    def _answers(self) -> bool:
        assert self.alive, "the daemon did not come up"
        try:
            DaemonClient(self._run, ARM).__exit__(None, None, None)
        except NoDaemon:
            return False
        return True

    def _wait(self, condition: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + LONGEST_S
        while not condition():
            assert time.monotonic() < deadline, f"not within {LONGEST_S:g} s: {what}"
            time.sleep(0.02)


def _serve(log: Path) -> None:
    """The forked child: never returns."""
    code = 1
    try:
        os.setsid()
        fd = os.open(log, os.O_WRONLY | os.O_CREAT | os.O_APPEND)
        os.dup2(fd, 1)
        os.dup2(fd, 2)
        try:
            run_daemon(load_installation(ARM), lockstep=True, ready=lambda: None)
            code = 0
        except (InputError, ArmStopped) as error:
            os.write(2, f"{error}\n".encode())
            code = 3
    finally:
        os._exit(code)


def _command_line(pid: int) -> bytes:
    try:
        return Path(f"/proc/{pid}/cmdline").read_bytes()
    except OSError:
        return b""


def _runs(pid: int) -> bool:
    try:
        return Path(f"/proc/{pid}/stat").read_text().rpartition(")")[2].split()[0] not in "ZX"
    except OSError:
        return False


@dataclass
class Attempt:
    """One session as its client sees it."""

    kind: str
    arguments: dict[str, Any]
    run: Path
    session: str | None = None
    stage: str = ""
    share: float = 0.0
    outcome: BaseException | dict[str, Any] | None = None
    over: threading.Event = field(default_factory=threading.Event)

    def begin(self) -> None:
        threading.Thread(target=self._follow, daemon=True).start()

    def _follow(self) -> None:
        try:
            with DaemonClient(self.run, ARM) as client:
                self.outcome = client.call(self.kind, self.arguments, self._hear)
        except (InputError, ArmStopped, NoDaemon, DaemonDefect, ConnectionError) as error:
            self.outcome = error
        finally:
            self.over.set()

    def _hear(self, news: dict[str, Any]) -> None:
        self.session, self.stage, self.share = news["session"], news["stage"], news["share"]

    def until(self, share: float) -> None:
        """Wait for the session to be so far, or over."""
        deadline = time.monotonic() + LONGEST_S
        while not self.over.is_set() and self.share < share:
            assert time.monotonic() < deadline, (self.kind, self.stage, self.share)
            time.sleep(0.002)


class Campaign:
    """Lives of the daemon one after another over one state directory."""

    def __init__(self, folder: Path, seed: int) -> None:
        self.run, self.log = folder / "run", folder / "daemon.log"
        self.store = SessionStore(folder / "state", ARM)
        self.models = folder / "state" / ARM / "models"
        self.rng = random.Random(seed)
        self.seen: Counter[str] = Counter()
        self.life = Life(self.run, self.log)

    def killed(self, kind: str, arguments: dict[str, Any]) -> Session | None:
        """One session killed somewhere, and the next life begun; the session, where one came to be."""
        attempt, victim = Attempt(kind, arguments, self.run), self.rng.choice(VICTIMS)
        attempt.begin()
        attempt.until(self.rng.random())
        time.sleep(self.rng.random() * JITTER_S)
        where = f"{kind}: {attempt.stage.split(' ')[0] or 'beginning'}" + (", over" if attempt.over.is_set() else "")
        self.life.kill(victim)
        assert attempt.over.wait(LONGEST_S), "its client was left waiting"
        self._next_life(victim)
        self.seen.update([victim, where])
        session = self._newest() if attempt.session is None else self.store.open(attempt.session)
        if session is not None:
            self.seen[f"session {session.record.state}"] += 1
            self.check(session)
        return session

    def done(self, kind: str, arguments: dict[str, Any]) -> dict[str, Any]:
        """One session to its end."""
        with DaemonClient(self.run, ARM) as client:
            if client.call("status")["state"] == "latched":
                client.call("reset")
            answer: dict[str, Any] = client.call(kind, arguments)
        return answer

    def check(self, session: Session) -> None:
        """What a session left can be read, and says how it ended."""
        record = session.record
        assert record.state in ENDED, record
        assert (record.cause is None) == (record.state == "done"), record
        if record.state == "done":
            assert session.result() is not None
        for path in session.directory.glob("*.mcap"):
            try:
                recording = read_recording(path)
            except InputError as problem:
                # Killed before the first tenth of a second of it was on the disk.
                assert record.state != "done" and "has no messages" in str(problem), problem
                self.seen["recordings without a message"] += 1
                continue
            self.seen["recordings read"] += 1
            assert np.all(np.diff(recording.t) > 0)
            assert np.isfinite(recording.q).mean() > 0.99

    def check_models(self) -> int:
        models = sorted(self.models.glob("[0-9]*.toml"))
        for path in models:
            assert read_model(path).arm == ARM
        return len(models)

    def resumed(self, session: Session, arguments: dict[str, Any]) -> None:
        """A practice that was killed is carried on, or says that there is nothing to carry on."""
        if session.record.state == "done":
            return
        if (session.directory / PRACTICE_FILE).exists():
            self.check(self.store.open(self.done("practise", {**arguments, "resume": session.id})["session"]))
            self.seen["practice carried on"] += 1
        else:
            try:
                self.done("practise", {**arguments, "resume": session.id})
            except InputError as problem:
                assert "has played nothing to its end" in str(problem)
                self.seen["practice without a play"] += 1

    def close(self) -> None:
        self.life.end()

    def _newest(self) -> Session | None:
        sessions = list(self.store.all())
        return sessions[-1] if sessions else None

    def _next_life(self, victim: str) -> None:
        if not self.life.alive:
            self.life = Life(self.run, self.log)
        else:
            assert victim == "recorder"
            with DaemonClient(self.run, ARM) as client:
                deadline = time.monotonic() + LONGEST_S
                while (status := client.call("status"))["recorder"]["state"] == "gone" or status["state"] == "playing":
                    assert time.monotonic() < deadline, "no fresh recorder"
                    time.sleep(0.1)
            self.life.recorder = status["recorder"]["pid"]
        with DaemonClient(self.run, ARM) as client:
            if client.call("status")["state"] == "latched":
                client.call("reset")


@contextlib.contextmanager
def campaign(folder: Path, seed: int) -> Iterator[Campaign]:
    """Over a stand-in that is there already."""
    made = Campaign(folder, seed)
    try:
        yield made
    finally:
        made.close()
