"""The recorder's handle: a process of its own that follows the loop's ring and writes one file a run."""

from __future__ import annotations

import multiprocessing
import threading
from collections.abc import Mapping, Sequence
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from config import InputError, Installation
from driver.recording.recorder import RecorderStatus, record

ANSWER_S = 30.0
KILLED_S = 1.0
"""A killed process is gone by then, unless the disk holds it."""


class RecorderProcess:
    """Handle of the recorder. The loop never waits for it, except in lockstep, where it reads every cycle.

    Methods raise InputError with one sentence when the recorder refuses or is gone. When the holder of the handle
    dies, the recorder completes the file in progress and ends.
    """

    def __init__(self, process: multiprocessing.process.BaseProcess, connection: Connection) -> None:
        self._process = process
        self._connection = connection
        self._asking = threading.Lock()
        self._hung = False

    @classmethod
    def start(cls, installation: Installation, ring_name: str, directory: Path) -> RecorderProcess:
        """Spawn the recorder of the loop that publishes in ``ring_name``; ``directory`` is where runs go by default."""
        context = multiprocessing.get_context("spawn")
        ours, theirs = context.Pipe()
        process = context.Process(
            target=record, args=(theirs, installation, ring_name, directory), name="etude-recorder", daemon=False
        )
        process.start()
        theirs.close()
        recorder = cls(process, ours)
        try:
            recorder._answer()
        except BaseException:
            recorder.close()
            raise
        return recorder

    @property
    def pid(self) -> int | None:
        return self._process.pid

    @property
    def alive(self) -> bool:
        """Whether it is there to be asked; one that did not answer in time is not any more."""
        return not self._hung and self._process.is_alive()

    @property
    def ending(self) -> str:
        """How it ended: "was killed by signal 9"."""
        code = self._process.exitcode
        if self._hung:
            return f"had not answered within {ANSWER_S:g} s and was killed"
        if code is None:
            return "still runs"
        return f"ended with exit code {code}" if code >= 0 else f"was killed by signal {-code}"

    def start_run(
        self, name: str, directory: Path | None = None, metadata: Mapping[str, str] | None = None,
        attach: Sequence[Path] = (),
    ) -> Path:  # fmt: skip
        """Record every cycle published from now on into ``<directory>/<name>.mcap``, or ``<name>-2.mcap`` … when
        that is taken; returns the path. ``metadata`` and the files ``attach`` (a model, say) are kept inside."""
        path: Path = self._ask("start_run", name, directory, dict(metadata or {}), tuple(attach))
        return path

    def stop_run(self) -> Path:
        """Complete the file with every cycle published until now; returns its path.

        Raises InputError when the disk gave out; the file then holds what fitted, and can be recovered.
        """
        path: Path = self._ask("stop_run")
        return path

    def status(self) -> RecorderStatus:
        status: RecorderStatus = self._ask("status")
        return status

    def close(self) -> None:
        """Complete the file in progress and end the process. Harmless when it is already gone."""
        self._connection.close()
        self._process.join(KILLED_S if self._hung else ANSWER_S)
        if self._process.is_alive() and not self._hung:
            self._process.kill()
            self._process.join()

    def __enter__(self) -> RecorderProcess:
        return self

    def __exit__(self, *_: object) -> None:
        self.close()

    def _ask(self, verb: str, *arguments: Any) -> Any:
        with self._asking:
            try:
                self._connection.send((verb, arguments))
            except OSError:
                raise self._gone() from None
            return self._answer()

    def _answer(self) -> Any:
        try:
            if not self._connection.poll(ANSWER_S):
                # An answer that came later would be taken for that of the next question.
                self._hung = True
                self._process.kill()
                raise InputError("recorder", f"has not answered within {ANSWER_S:g} s", "see whether the disk hangs")
            value, problem = self._connection.recv()
        except (EOFError, OSError):
            raise self._gone() from None
        if problem is not None:
            raise InputError(*problem)
        return value

    def _gone(self) -> InputError:
        return InputError(
            "recorder",
            "its process is gone",
            "what it had written can be recovered",
        )
