"""The recorder as the daemon keeps it: when its process dies, its file is recovered and a fresh one takes its place."""

from __future__ import annotations

import logging
import threading
import time
from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Literal

from config import InputError, Installation
from driver.recording import RecorderProcess, recover

log = logging.getLogger(__name__)
PAUSE_S = 10.0
"""Between two fresh starts that nobody asked for: a recorder that cannot live is not started over and over."""


@dataclass(frozen=True)
class RecorderReport:
    """The recorder now. ``restarts``: since the daemon began; ``last_death``: what ended the one before, a sentence."""

    state: Literal["ready", "recording", "gone"]
    pid: int | None
    path: Path | None
    """The file in progress."""
    restarts: int
    last_death: str | None


class StandingRecorder:
    """One recorder process after another on one loop's ring. Thread-safe.

    A run whose recorder dies is lost from there on: `stop_run` says so, with what was recovered of it. The next run
    has a fresh recorder. Starting raises InputError when there is no such ring.
    """

    def __init__(self, installation: Installation, ring_name: str, directory: Path) -> None:
        self._of = installation, ring_name, directory
        self._process = RecorderProcess.start(*self._of)
        self._buried = False
        self._doing = threading.Lock()
        self._tried_s = time.monotonic()
        self._run: Path | None = None
        self._lost: InputError | None = None
        """Why the run in progress has no recorder any more."""
        self._restarts = 0
        self._last_death: str | None = None

    def start_run(self, name: str, directory: Path, metadata: Mapping[str, str]) -> Path:
        """Record every cycle from now on; returns the file's path. Raises InputError when that cannot begin."""
        with self._doing:
            self._revive()
            self._run = self._process.start_run(name, directory, metadata)
            self._lost = None
            return self._run

    def stop_run(self) -> Path:
        """Complete the file; returns its path. Raises InputError when it is not whole, with what is kept of it."""
        with self._doing:
            try:
                self._bury_the_dead()
                if self._lost is None:
                    return self._process.stop_run()
            except InputError:
                # The disk refused, or the recorder died just now.
                self._bury_the_dead()
                if self._lost is None:
                    raise
            finally:
                lost, self._run, self._lost = self._lost, None, None
            assert lost is not None
            raise lost

    def revive(self) -> None:
        """See to it that a recorder lives. Raises InputError when none can be started."""
        with self._doing:
            self._revive()

    def revive_in_time(self) -> None:
        """The same for who merely watches: not too often, and what goes wrong is only logged."""
        if not self._process.alive and time.monotonic() - self._tried_s > PAUSE_S:
            try:
                self.revive()
            except InputError as problem:
                log.error("no recorder: %s", problem)

    def report(self) -> RecorderReport:
        """Never waits."""
        alive, path = self._process.alive, None if self._lost else self._run
        state: Literal["ready", "recording", "gone"] = "gone" if not alive else "recording" if path else "ready"
        return RecorderReport(state, self._process.pid if alive else None, path, self._restarts, self._last_death)

    def close(self) -> None:
        """Complete the file in progress and end the process."""
        with self._doing:
            self._process.close()

    def _revive(self) -> None:
        self._bury_the_dead()
        if not self._buried:
            return
        self._tried_s = time.monotonic()
        self._process = RecorderProcess.start(*self._of)
        self._buried = False
        self._restarts += 1
        log.warning("a fresh recorder runs (process %s)", self._process.pid)

    def _bury_the_dead(self) -> None:
        """Recover what a recorder that died was writing, once, and keep in words what became of it."""
        dead = self._process
        if self._buried or dead.alive:
            return
        dead.close()
        self._buried = True
        self._last_death = f"its process {dead.ending}"
        if self._run is not None:
            self._last_death += f"; {_kept_of(self._run)}"
            self._lost = InputError("recorder", self._last_death, "begin again: a fresh recorder takes its place")
        log.error("recorder: %s", self._last_death)


def _kept_of(path: Path) -> str:
    """What a recovery leaves of a recording whose recorder died, in words."""
    try:
        report = recover(path)
    except InputError as problem:
        return f"nothing of {path.name} can be read ({problem.problem})"
    return f"the {report.seconds:.2f} s that it had written of {path.name} are kept"
