"""What the wrist carries while the arm moves: a process of its own follows the loop's ring and tells what it knows."""

from __future__ import annotations

import logging
import multiprocessing
import os
import signal
import time
from collections.abc import Sequence
from dataclasses import replace
from multiprocessing.connection import Connection
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError, Installation
from driver.cyclic.cycle import Cycle, LoopState, WrenchSample
from driver.cyclic.ring import RingReader
from driver.process_name import name_process
from service.identification.request import LOAD_FILE

log = logging.getLogger(__name__)
NICENESS = 10
FEED_HZ = 250.0
"""As many samples a second are used: the rows are far slower."""
POLL_S = 0.1
AT_ONCE = 4096
STALE_NS = 100_000_000
"""A wrench older than this is none."""
AT_WORK = (LoopState.ENABLING, LoopState.HOLDING, LoopState.PLAYING)


class LiveLoadProcess:
    """Follows one enabling of the arm, and ends by itself when the drives are off again or the loop is gone.

    ``known``: files of loads that it may be. Those that a session has identified go by the session's name.
    """

    def __init__(self, installation: Installation, ring_name: str, known: Sequence[Path] = ()) -> None:
        context = multiprocessing.get_context("spawn")
        self._news, theirs = context.Pipe(duplex=False)
        self._process = context.Process(
            target=_follow, args=(theirs, installation, ring_name, tuple(known)), name="etude-live-load", daemon=True
        )
        self._process.start()
        theirs.close()
        self._latest: dict[str, Any] | None = None
        self._ready = False

    def latest(self) -> dict[str, Any] | None:
        """``mass`` {value, standard_error, unit} and ``name`` of the known load that it is, or None, as last told, also
        after the end; None before. Never waits."""
        self._hear(0.0)
        return self._latest

    def wait_ready(self, seconds: float) -> bool:
        """Wait until it follows the ring; whether it does."""
        deadline = time.monotonic() + seconds
        while not self._ready and time.monotonic() < deadline and self._process.is_alive():
            self._hear(POLL_S)
        return self._ready

    def _hear(self, seconds: float) -> None:
        try:
            while self._news.poll(seconds):
                self._latest, self._ready, seconds = self._news.recv(), True, 0.0
        except (EOFError, OSError):
            # It has ended, maybe in the middle of a word, or was closed meanwhile: what it told last stays.
            return

    def close(self) -> None:
        """End it, if it has not ended."""
        self._process.terminate()
        self._process.join()
        self._news.close()


def last_identified(sessions: Path) -> list[Path]:
    """The file of the load that the newest of an arm's sessions to identify one has left there; none before."""
    return sorted(sessions.glob(f"*-identify-load*/{LOAD_FILE}"))[-1:]


def _follow(connection: Connection, installation: Installation, ring_name: str, known: Sequence[Path]) -> None:
    name_process("etude-live-load")
    signal.signal(signal.SIGINT, signal.SIG_IGN)
    os.nice(NICENESS)
    # Numerical libraries are loaded here, not in the daemon.
    from estimator.loads import LiveLoad, RigidLoad
    from estimator.rigid_body import load_rigid_body
    from service.identification.load_file import read_loads

    sensor = installation.wrench_sensor[0]
    body = load_rigid_body(installation.path.parent / installation.arm.urdf)
    columns = [installation.joint_names.index(joint) for joint in body.joints]
    loads: list[RigidLoad] = []
    for path in known:
        try:
            found = read_loads(path)
        except InputError as problem:
            log.warning("the load is followed without what was known of it: %s", problem)
            continue
        loads += [replace(load, name=path.parent.name) for load in found] if path.name == LOAD_FILE else found
    limits = np.array([sensor.range_n] * 3 + [sensor.range_nm] * 3)
    with RingReader(ring_name) as ring:
        every = max(1, round(1e9 / ring.period_ns / FEED_HZ))
        live = LiveLoad(body, sensor.frame, 1e9 / ring.period_ns / every, limits, loads)
        told, felt = None, None
        connection.send(None)
        while not ring.ended and (newest := ring.latest()) is not None and newest.state in AT_WORK:
            _, cycles = ring.cycles(AT_ONCE)
            for cycle in cycles:
                if cycle.wrench is not None and cycle.wrench.fresh:
                    felt = cycle.wrench
                if cycle.index % every == 0 and felt is not None:
                    live.feed(*_sample(cycle, felt, columns))
            mass, name = live.mass, live.recognised
            if mass is not None and (now := (float(mass.value), float(mass.standard_error), name)) != told:
                told = now
                try:
                    connection.send({"mass": {"value": now[0], "standard_error": now[1], "unit": "kg"}, "name": name})
                except BrokenPipeError:
                    return
            time.sleep(POLL_S)


def _sample(cycle: Cycle, felt: WrenchSample, columns: list[int]) -> tuple[Any, ...]:
    """Of one cycle: time s, angles, velocities, the wrench felt last and when; NaN where that is stale."""
    wrench = np.array([felt.values if cycle.time_ns - felt.stamp_ns < STALE_NS else [np.nan] * 6])
    q, dq = np.array([cycle.q])[:, columns], np.array([cycle.dq])[:, columns]
    return np.array([cycle.time_ns * 1e-9]), q, dq, wrench, np.array([felt.stamp_ns * 1e-9])
