"""The watchdog is fed by good cycles alone."""

from __future__ import annotations

import asyncio
import socket
from types import SimpleNamespace
from typing import Any

import pytest

from config import InputError
from driver.cyclic.cycle import LoopState
from service.daemon.watchdog import watch


class FakeLoop:
    """A loop whose good cycles go up as told; each status that is not a number is the sentence it fails with."""

    def __init__(self, *good_cycles: int | str) -> None:
        self.left = list(good_cycles)
        self.alive = True

    def status(self) -> Any:
        value = self.left.pop(0)
        self.alive = bool(self.left)
        if isinstance(value, str):
            raise InputError("cyclic loop", value)
        return SimpleNamespace(state=LoopState.IDLE, cycles=9, missed=0, good_cycles=value)


def signs_of_life(monkeypatch: pytest.MonkeyPatch, loop: FakeLoop, *, lockstep: bool) -> tuple[int, str]:
    monkeypatch.setenv("WATCHDOG_USEC", "3000")
    monkeypatch.delenv("WATCHDOG_PID", raising=False)
    with socket.socket(socket.AF_UNIX, socket.SOCK_DGRAM) as manager:
        manager.bind("")
        monkeypatch.setenv("NOTIFY_SOCKET", "@" + manager.getsockname()[1:].decode())
        manager.setblocking(False)
        reason = asyncio.run(asyncio.wait_for(watch(loop, lockstep=lockstep), 20))
        count = 0
        while True:
            try:
                count += manager.recv(1000).startswith(b"WATCHDOG=1")
            except BlockingIOError:
                return count, reason


def test_only_new_good_cycles_feed_it(monkeypatch: pytest.MonkeyPatch) -> None:
    fed, reason = signs_of_life(monkeypatch, FakeLoop(10, 20, 20, 20, 30, "is gone"), lockstep=False)
    assert fed == 3
    assert "is gone" in reason


def test_in_lockstep_an_answer_feeds_it(monkeypatch: pytest.MonkeyPatch) -> None:
    fed, _ = signs_of_life(monkeypatch, FakeLoop(10, 10, 10, "is gone"), lockstep=True)
    assert fed == 3


def test_a_loop_that_lives_but_does_not_answer_starves_it(monkeypatch: pytest.MonkeyPatch) -> None:
    fed, reason = signs_of_life(monkeypatch, FakeLoop(10, "no answer", "no answer", 20, "is gone"), lockstep=False)
    assert fed == 2
    assert "is gone" in reason
