"""One arm, brought up as processes on whichever bus the test asks for."""

from __future__ import annotations

import json
import os
import shutil
import socket
import subprocess
import sys
import tempfile
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import pytest

from config.loader import installation_path
from service.supervision import SupervisedProcess


def interface_is_up(name: str) -> bool:
    """Whether this kernel has a CAN interface of that name that can be bound."""
    try:
        with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as s:
            s.bind((name,))
    except OSError:
        return False
    return True


@dataclass
class Bench:
    """An arm on a bench: its installation file, a motion and how far it goes, its directories, and the commands of the
    house on them."""

    config: Path
    motion: str
    span_deg: float
    lockstep: bool
    folder: Path
    running: list[SupervisedProcess] = field(default_factory=list)

    @property
    def environment(self) -> dict[str, str]:
        return {"ETUDE_RUN": str(self.folder / "run"), "ETUDE_STATE": str(self.folder / "state")}

    def start(self, command: str, *arguments: str) -> SupervisedProcess:
        """`etude <command> --config …` as a process of its own, ready."""
        flags = ["--lockstep"] if self.lockstep else []
        process = SupervisedProcess([command, "--config", str(self.config), *flags, *arguments], self.environment)
        self.running.append(process)
        process.wait_ready(90)
        return process

    def etude(self, *arguments: str) -> subprocess.CompletedProcess[str]:
        """A client command, waited for."""
        return subprocess.run(
            [sys.executable, "-m", "service", *arguments],
            env={**os.environ, **self.environment},
            capture_output=True,
            text=True,
            timeout=300,
            check=False,
        )

    def answer(self, *arguments: str) -> dict[str, Any]:
        """The JSON answer of a command that must succeed."""
        done = self.etude(*arguments, "--json", "-")
        assert done.returncode == 0, done.stderr
        answer: dict[str, Any] = json.loads(done.stdout)
        return answer

    def stop(self) -> None:
        while self.running:
            self.running.pop().stop()


@pytest.fixture
def bench_on(for_any_machine: Callable[[Path], Path]) -> Iterator[Callable[..., Bench]]:
    """``bench_on(bus, arm="dda")`` with bus "lockstep", "local" or "socketcan"; the channels are put in the
    installation's own file, nothing else differs."""
    benches: list[Bench] = []

    def make(bus: str, arm: str = "dda") -> Bench:
        folder = Path(tempfile.mkdtemp(prefix="etude-"))
        source = installation_path(arm)
        shutil.copytree(source.parent, folder / arm)
        config = folder / arm / source.name
        motion, span_deg = "dda-identify-2", 250.0
        if bus == "socketcan":
            text = config.read_text()
            for k in range(text.count('channel = "local:')):
                if not interface_is_up(f"vcan{k}"):
                    pytest.skip(f"no CAN interface vcan{k} here; make test-vcan brings one")
                text = text.replace(f'channel = "local:{arm}-can{k}"', f'channel = "socketcan:vcan{k}"')
            config.write_text(text)
        elif bus == "local":
            motion, span_deg = str(for_any_machine(config)), 60.0
        bench = Bench(config, motion, span_deg, bus == "lockstep", folder)
        for name in ("run", "state"):
            (folder / name).mkdir()
        benches.append(bench)
        return bench

    yield make
    for bench in benches:
        bench.stop()
        shutil.rmtree(bench.folder, ignore_errors=True)
