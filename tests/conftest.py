"""What holds for every test: one numerical thread, as in the service; hypothesis draws the same examples on every run,
and waits for no clock; and no process outlives the tests."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Iterator
from pathlib import Path

import pytest
from hypothesis import settings

import service as service  # sets the threads, before NumPy is loaded

settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")

MARK = f"ETUDE_TESTS={os.getpid()}"


@pytest.fixture(scope="session", autouse=True)
def nothing_is_left_running() -> Iterator[None]:
    """Kill what tests have started and not ended, stopped processes too: a test that failed half-way, a fixture that
    could not end its process."""
    name, _, value = MARK.partition("=")
    os.environ[name] = value
    yield
    for pid in started_and_alive():
        print(f"killed a process that a test has left: {command_line(pid)}", file=sys.stderr)
        with contextlib.suppress(ProcessLookupError):
            os.kill(pid, signal.SIGKILL)


def started_and_alive() -> list[int]:
    """Processes that inherited this session's mark, at whatever depth; not Python's own tracker of shared memory."""
    found = []
    for entry in Path("/proc").glob("[0-9]*"):
        try:
            marked = MARK.encode() in (entry / "environ").read_bytes().split(b"\0")
        except OSError:
            continue  # it has ended meanwhile, or is not ours to see
        if marked and int(entry.name) != os.getpid() and "resource_tracker" not in command_line(int(entry.name)):
            found.append(int(entry.name))
    return found


def command_line(pid: int) -> str:
    try:
        return Path(f"/proc/{pid}/cmdline").read_text().replace("\0", " ").strip()
    except OSError:
        return ""
