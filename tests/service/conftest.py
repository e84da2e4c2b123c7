"""Directories of a test's own, and an arm brought up as processes once for the tests that only ask it things."""

from __future__ import annotations

import json
import os
import shutil
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import pytest

from config.loader import installation_path
from service.supervision import SupervisedProcess
from tests.service.pendulum import URDF

READY_S = 90.0
SLOW = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.2, 2.4, 1.4], [3.58, 2.69, 1.75]]
duration_s = [8.0, 8.0]
"""


@pytest.fixture
def urdf(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> Path:
    """Of the pendulum, which no configuration knows; models are kept in the test's own state."""
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))
    path = tmp_path / "stranger.urdf"
    path.write_text(URDF)
    return path


def _hear_ctrl_c() -> None:
    """As at a terminal: tests that run in a shell's background inherit that SIGINT is ignored."""
    signal.signal(signal.SIGINT, signal.SIG_DFL)


@dataclass
class House:
    """Run and state directories, and the commands of the house on them."""

    folder: Path

    @property
    def environment(self) -> dict[str, str]:
        return {"ETUDE_RUN": str(self.folder / "run"), "ETUDE_STATE": str(self.folder / "state"), "ETUDE_ARM": ""}

    def popen(self, *arguments: str) -> subprocess.Popen[str]:
        return subprocess.Popen(
            [sys.executable, "-m", "service", *arguments],
            env={**os.environ, **self.environment},
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            preexec_fn=_hear_ctrl_c,
        )

    def etude(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """A command, waited for."""
        process = self.popen(*arguments)
        out, err = process.communicate(timeout=280)
        return subprocess.CompletedProcess(process.args, process.returncode, out, err)

    def answer(self, *arguments: str) -> dict[str, Any]:
        """The JSON answer of a command that must succeed."""
        done = self.etude(*arguments, "--json", "-")
        assert done.returncode == 0, done.stderr
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer

    def arm_files(self, arm: str = "dda") -> Path:
        """A copy of an arm's files that a test may spoil; returns the installation file."""
        source = installation_path(arm)
        shutil.copytree(source.parent, self.folder / "arm")
        return self.folder / "arm" / source.name

    def processes(self) -> list[int]:
        """Processes that work in this run directory."""
        marker = f"ETUDE_RUN={self.environment['ETUDE_RUN']}".encode()
        found = []
        for entry in Path("/proc").glob("[0-9]*"):
            try:
                if int(entry.name) != os.getpid() and marker in (entry / "environ").read_bytes().split(b"\0"):
                    found.append(int(entry.name))
            except OSError:
                continue  # it has ended meanwhile, or is not ours to see
        return found

    def process(self, words: bytes) -> int:
        """The one process with these words in its command line, or of this name."""
        found = [
            pid
            for pid in self.processes()
            if any(words in Path(f"/proc/{pid}/{told}").read_bytes() for told in ("cmdline", "comm"))
        ]
        assert len(found) == 1, (words, found)
        return found[0]

    def wait_until(self, condition: Callable[[], bool], what: str) -> None:
        deadline = time.monotonic() + 60
        while not condition():
            assert time.monotonic() < deadline, f"not within a minute: {what}"
            time.sleep(0.1)


@pytest.fixture
def house(monkeypatch: pytest.MonkeyPatch) -> Iterator[House]:
    """Fresh directories under short paths (AF_UNIX), also for commands run inside the test's own process."""
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        made = House(Path(folder))
        for name, value in made.environment.items():
            monkeypatch.setenv(name, value)
        yield made


@pytest.fixture(scope="session")
def new_house() -> type[House]:
    """Makes a house in a folder, for fixtures that outlive a test."""
    return House


@pytest.fixture(scope="module")
def running_house() -> Iterator[House]:
    """The direct drive arm's stand-in and daemon, up in lockstep for all tests of a module."""
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        made = House(Path(folder))
        running = []
        try:
            for command in ("virtual", "daemon"):
                process = SupervisedProcess([command, "--config", "dda", "--lockstep"], made.environment)
                running.append(process)
                process.wait_ready(READY_S)
            yield made
        finally:
            for process in reversed(running):
                process.stop()


@pytest.fixture
def start(house: House) -> Iterator[Callable[..., SupervisedProcess]]:
    """Starts `etude virtual` or `etude daemon`, ready, of the direct drive arm in lockstep or as the arguments say;
    all are ended at last."""
    running: list[SupervisedProcess] = []

    def starting(command: str, *arguments: str) -> SupervisedProcess:
        process = SupervisedProcess([command, *(arguments or ("--config", "dda", "--lockstep"))], house.environment)
        running.append(process)
        process.wait_ready(READY_S)
        return process

    yield starting
    for process in reversed(running):
        process.stop()
    house.wait_until(lambda: house.processes() == [], "no process is left")


@pytest.fixture
def playing(house: House, tmp_path: Path) -> Callable[..., subprocess.Popen[str]]:
    """Starts a client whose slow motion is being played."""

    def begin(*options: str) -> subprocess.Popen[str]:
        path = tmp_path / "slow.toml"
        path.write_text(SLOW)
        client = house.popen("run", str(path), *options)
        assert client.stderr is not None
        assert any(line.startswith("playing") for line in client.stderr), client.wait()
        return client

    return begin
