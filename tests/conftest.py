"""What holds for every test: one numerical thread, as in the service; hypothesis draws the same examples on every run,
and waits for no clock; and no process outlives the tests."""

from __future__ import annotations

import contextlib
import os
import signal
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest
from hypothesis import settings

import service as service  # sets the threads, before NumPy is loaded

settings.register_profile("seeded", derandomize=True, deadline=None)
settings.load_profile("seeded")

SLOWLY = """
kind = "polynomial"
way_points_rad = [[3.5779, 2.6896, 1.7453], [4.6251, 1.6424, 2.7925]]
duration_s = [8]
"""
"""The direct drive arm from its home by 60 degrees, at 0.25 rad/s at most."""

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


@pytest.fixture
def for_any_machine() -> Callable[[Path], Path]:
    """Makes a copied installation of the direct drive arm fit for wall-clock time on a machine that is busy with other
    things, and gives the file of a motion so slow that an arm left alone for a second is not far from where it
    should be."""

    def patient(config: Path) -> Path:
        text = config.read_text().replace("rate_hz = 1000", "rate_hz = 100\nmissed_deadlines_to_stop = 100")
        text = text.replace("heartbeat_ms = 20", "heartbeat_ms = 1000")
        config.write_text(text.replace("torque_rate_nm_s =", "following_error_rad = 0.5, torque_rate_nm_s ="))
        motion = config.parent / "slowly.toml"
        motion.write_text(SLOWLY)
        return motion

    return patient


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
