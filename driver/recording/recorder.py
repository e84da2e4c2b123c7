"""What runs in the recorder's process: commands between readings of the loop's ring, one file a run."""

from __future__ import annotations

import gc
import re
import signal
import threading
import time
from collections import deque
from collections.abc import Callable
from contextlib import suppress
from dataclasses import dataclass
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

from config import InputError, Installation
from driver.cyclic.cycle import Cycle
from driver.cyclic.ring import RingReader
from driver.process_name import name_process
from driver.recording.message_records import LogRecord
from driver.recording.run_writer import RunWriter

POLL_S = 0.005
"""How often the ring is looked at while recording; it holds seconds."""
IDLE_POLL_S = 0.05
"""The same while nothing is recorded."""
QUIET_FLUSH_S = 0.05
"""On the wall clock: when the loop falls silent, what is there goes to disk after this."""
BATCH = 256
SUFFIX = ".mcap"
WARM_UP_CYCLES = 20
"""Cycles before a run whose raw channels are kept with it, for what decoders remember."""


@dataclass(frozen=True)
class RecorderStatus:
    """What the recorder does. ``problem``: why the file in progress had to be given up, one sentence."""

    path: Path | None
    cycles: int
    lost: int
    """Cycles that the loop overwrote before they could be written; each loss is also noted in /events."""
    problem: str | None


class Recorder:
    """Follows the ring; writes the run in progress."""

    def __init__(self, installation: Installation, ring: RingReader, directory: Path) -> None:
        self._installation = installation
        self._ring = ring
        self._directory = directory
        self._writer: RunWriter | None = None
        self._path: Path | None = None
        self._problem: str | None = None
        self._lost = 0
        self._before: deque[Cycle] = deque(maxlen=WARM_UP_CYCLES)
        """The newest cycles that are not in the file in progress."""
        self._flushed = True
        self._heard_s = time.monotonic()
        self.recording = False

    def start_run(
        self, name: str, directory: Path | None, metadata: dict[str, str], attach: tuple[Path, ...]
    ) -> Path:  # fmt: skip
        if self.recording:
            raise InputError("recorder", f"is already recording {self._path}", "stop that run first")
        if not re.fullmatch(r"[^/\0]{1,200}", name) or name in (".", ".."):
            raise InputError("recorder", f"{name!r} cannot name a file", "choose a name without slashes")
        path = _free_path(directory or self._directory, name)
        self._discard()
        self._writer = RunWriter(path, self._installation, metadata, attach)
        for cycle in self._before:
            self._writer.warm_up(cycle)
        self._path, self._problem, self._lost, self.recording = path, None, 0, True
        return path

    def stop_run(self) -> Path:
        if not self.recording or self._path is None:
            raise InputError("recorder", "is not recording", "start a run first")
        self.drain()
        self.recording = False
        if self._writer is not None:
            try:
                self._writer.finish()
            except OSError as error:
                self._give_up(error)
            self._writer = None
        if self._problem is not None:
            raise InputError(str(self._path), self._problem, "free some space, then recover the file")
        return self._path

    def status(self) -> RecorderStatus:
        cycles = self._writer.cycles if self._writer else 0
        return RecorderStatus(self._path if self.recording else None, cycles, self._lost, self._problem)

    def follow(self) -> bool:
        """Take what the ring has; True when it had something."""
        if self._writer is None:
            return self._discard()
        if self.drain():
            self._heard_s, self._flushed = time.monotonic(), False
            return True
        # In lockstep silence only means that virtual time stands; chunks end by virtual time alone there.
        if not self._flushed and not self._ring.lockstep and time.monotonic() - self._heard_s > QUIET_FLUSH_S:
            self._guarded_flush()
        return False

    def drain(self) -> bool:
        """Write every cycle published so far; True when there was one."""
        head, some = self._ring.head, False
        while self._ring.cursor < head:
            lost, cycles = self._ring.cycles(BATCH)
            some = True
            if self._writer is None:
                continue
            try:
                if lost:
                    self._lost += lost
                    self._writer.note(f"recorder: {lost} cycles were lost, the disk was too slow", LogRecord.ERROR)
                for cycle in cycles:
                    self._writer.write(cycle)
                self._before.extend(cycles[-WARM_UP_CYCLES:])
            except OSError as error:
                self._give_up(error)
        return some

    def _discard(self) -> bool:
        head, some = self._ring.head, False
        while self._ring.cursor < head:
            slots = self._ring.take(BATCH).slots[-WARM_UP_CYCLES:]
            self._before.extend(self._ring.codec.decode(slot) for slot in slots)
            some = True
        return some

    def _guarded_flush(self) -> None:
        if self._writer is not None:
            try:
                self._writer.flush()
            except OSError as error:
                self._give_up(error)
        self._flushed = True

    def _give_up(self, error: OSError) -> None:
        """The disk refused: keep what is on it, stop writing, remember why. The loop goes on unaffected."""
        self._problem = f"could not be written to its end ({error.strerror})"
        if self._writer is not None:
            self._writer.abandon()
            self._writer = None

    def close(self) -> None:
        if self.recording:
            with suppress(InputError):  # nobody is left to tell; the file says it by having no end
                self.stop_run()
        self._ring.close()


def record(connection: Connection, installation: Installation, ring_name: str, directory: Path) -> None:
    """Body of the recorder's process: serves commands on ``connection`` until its other end closes, or SIGTERM."""
    name_process("etude-recorder")
    ending = threading.Event()
    signal.signal(signal.SIGTERM, lambda *_: ending.set())
    # A Ctrl-C at the terminal is for the daemon, which closes the connection in order.
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    try:
        ring = RingReader(ring_name)
    except InputError as error:
        connection.send((None, (error.place, error.problem, error.remedy)))
        return
    if ring.lockstep:
        ring.register_recorder()
    recorder = Recorder(installation, ring, directory)
    # Cycles are freed as they are written; looking for cyclic garbage among them costs a third of the time.
    gc.freeze()
    gc.set_threshold(200_000)
    connection.send((None, None))
    try:
        while not ending.is_set():
            busy = recorder.follow()
            pause = 0.0 if busy and ring.lockstep else POLL_S if recorder.recording or ring.lockstep else IDLE_POLL_S
            if connection.poll(pause):
                _serve(recorder, connection)
    except (EOFError, ConnectionError):
        ending.set()
    finally:
        recorder.close()


def _serve(recorder: Recorder, connection: Connection) -> None:
    verb, arguments = connection.recv()
    commands: dict[str, Callable[..., Any]] = {
        "start_run": recorder.start_run,
        "stop_run": recorder.stop_run,
        "status": recorder.status,
    }
    try:
        connection.send((commands[verb](*arguments), None))
    except InputError as error:
        connection.send((None, (error.place, error.problem, error.remedy)))


def _free_path(directory: Path, name: str) -> Path:
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(directory), f"cannot be made ({error.strerror})", "check the path") from None
    path, number = directory / f"{name}{SUFFIX}", 2
    while path.exists():
        path, number = directory / f"{name}-{number}{SUFFIX}", number + 1
    return path
