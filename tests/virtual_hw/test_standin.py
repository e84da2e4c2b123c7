"""The stand-in as a process of its own: one seed, one run; one stand-in a bus; a clean end."""

from __future__ import annotations

import hashlib
import os
import signal
import struct
import subprocess
import sys
from collections.abc import Callable, Iterator
from pathlib import Path

import pytest

from tests.virtual_hw.local_host import Host, tick
from virtual_hw.bus.frames import frame

START_NS = 1_700_000_000_000_000_000
HERE = Path(__file__).parent
Start = Callable[..., "subprocess.Popen[str]"]


@pytest.fixture
def start(tmp_path: Path) -> Iterator[Start]:
    """Starts a stand-in of the direct drive arm in ``tmp_path`` and ends it afterwards."""
    running: list[subprocess.Popen[str]] = []

    def begin(mode: str = "lockstep", seed: int = 0, directory: Path = tmp_path, wait: str = "ready") -> object:
        process = subprocess.Popen(
            [sys.executable, str(HERE / "standin_process.py"), "dda", str(directory), mode, str(seed)],
            stdout=subprocess.PIPE,
            text=True,
            env={**os.environ, "PYTHONPATH": str(HERE.parents[1])},
        )
        running.append(process)
        assert process.stdout is not None
        said = process.stdout.readline()
        assert wait in said
        return process

    yield begin
    for process in running:
        process.kill()
        process.wait()
        assert process.stdout is not None
        process.stdout.close()


def motion_bytes(directory: Path, cycles: int = 60) -> bytes:
    """Everything all buses tell a host that enables torque mode and pushes."""
    heard = hashlib.sha256()
    hosts = [Host(directory / f"dda-can{k}") for k in range(3)]
    for node, host in enumerate(hosts, 1):
        for index, subindex, value in (
            (0x6060, 0, b"\x0a"),
            (0x1400, 2, b"\x01"),
            (0x1800, 2, b"\x01"),
            (0x1802, 2, b"\x01"),
            (0x1803, 2, b"\x01"),
        ):
            size = 0x2F
            host.send(frame(0x600 + node, struct.pack("<BHB4s", size, index, subindex, value)))
            assert host.receive()[0][8] == 0x60
        host.send(frame(0x000, bytes((0x01, node))))
    t_ns = START_NS
    for k in range(cycles):
        t_ns += 1_000_000
        word = (0x06, 0x07, 0x0F)[min(k // 2, 2)]
        for node, host in reversed(list(enumerate(hosts, 1))):
            torque = frame(0x600 + node, struct.pack("<BHBh2x", 0x2B, 0x6071, 0, 10 * node))
            command = frame(0x200 + node, struct.pack("<H", word))
            host.send(command, torque, tick(t_ns), frame(0x080), tick(t_ns + 600_000))
        for host in hosts:
            heard.update(b"".join(host.until_mark(t_ns + 600_000)))
    final = [host.sdo_read(node, 0x6041) & 0x6F for node, host in enumerate(hosts, 1)]
    assert final == [0x27] * 3
    for host in hosts:
        host.socket.close()
    return heard.digest()


def test_equal_seeds_give_equal_bytes_and_others_do_not(start: Start, tmp_path: Path) -> None:
    digests = []
    for run, seed in enumerate((7, 7, 8)):
        directory = tmp_path / str(run)
        directory.mkdir()
        process = start(seed=seed, directory=directory)
        digests.append(motion_bytes(directory))
        process.send_signal(signal.SIGTERM)
        assert process.wait(10) == 0
        assert list(directory.iterdir()) == []
    assert digests[0] == digests[1] != digests[2]


def test_a_second_stand_in_is_refused_and_takes_nothing_from_the_first(start: Start, tmp_path: Path) -> None:
    first = start("wall")
    second = start("wall", wait="another stand-in arm runs on this bus")
    assert second.wait(10) == 2
    assert (tmp_path / "dda-wrist").is_symlink()
    with Host(tmp_path / "dda-can0") as host:
        assert host.sdo_read(1, 0x1000) == 0x00020192
    first.send_signal(signal.SIGTERM)
    assert first.wait(10) == 0
    assert list(tmp_path.iterdir()) == []
