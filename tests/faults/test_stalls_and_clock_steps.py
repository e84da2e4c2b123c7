"""The exchange in wall-clock time, on a clock of the test's own: stalls are skipped over, steps of the clock unseen."""

from __future__ import annotations

import socket
from collections.abc import Iterator
from dataclasses import dataclass, field
from itertools import pairwise
from typing import Any

import pytest

from config import Installation, load_installation
from driver.cia402.pdo import SYNC, PdoCodec
from driver.cyclic import exchange
from driver.cyclic.exchange import LATEST_START, WallClockExchange

MS = 1_000_000
CYCLES = 400


@dataclass
class Clock:
    """Stands in for the module ``time``: sleeping moves it, and so does the test."""

    since_boot: int = 5_000 * MS
    calendar: int = 1_700_000_000_000 * MS

    def monotonic_ns(self) -> int:
        return self.since_boot

    def time_ns(self) -> int:
        return self.calendar

    def sleep(self, seconds: float) -> None:
        self.stall(max(0, round(seconds * 1e9)))

    def stall(self, ns: int) -> None:
        self.since_boot += ns
        self.calendar += ns


@dataclass
class Wire:
    """A channel that only notes when something was sent."""

    clock: Clock
    end: socket.socket
    sent: list[tuple[int, bytes]] = field(default_factory=list)
    hello_ns: int | None = None

    def fileno(self) -> int:
        return self.end.fileno()

    def send(self, data: bytes) -> None:
        self.sent.append((self.clock.since_boot, bytes(data)))

    def drain(self, _buffer: bytearray) -> int:
        return 0

    def close(self) -> None:
        self.end.close()

    @property
    def syncs(self) -> list[int]:
        return [at for at, data in self.sent if data == SYNC]


@dataclass
class Bench:
    clock: Clock
    wires: list[Wire]
    exchange: WallClockExchange

    def cycle(self) -> Any:
        begun = self.exchange.begin()
        self.exchange.collect()
        self.exchange.command([b"\0" * 16 for _ in self.wires])
        return begun


@pytest.fixture(scope="module")
def dda() -> Installation:
    return load_installation("dda")


@pytest.fixture
def bench(dda: Installation, monkeypatch: pytest.MonkeyPatch) -> Iterator[Bench]:
    clock = Clock()
    monkeypatch.setattr(exchange, "time", clock)
    pairs = [socket.socketpair() for _ in dda.bus]
    wires = [Wire(clock, near) for near, _ in pairs]
    yield Bench(clock, wires, WallClockExchange(dda, wires, PdoCodec(dda, "csp")))  # type: ignore[arg-type]
    for near, far in pairs:
        near.close()
        far.close()


@pytest.mark.parametrize("stall_ms", [2, 5, 10, 20, 49.6, 50])
@pytest.mark.parametrize("where", ["before the cycle", "before the feedback"])
def test_a_stall_is_skipped_over_and_never_made_up_for(bench: Bench, stall_ms: float, where: str) -> None:
    """No burst: SYNCs stay at least half a period apart, commands are one a cycle, the rhythm is the old one."""
    period = bench.exchange.period_ns
    skipped = []
    for k in range(CYCLES):
        if k % 100 == 50:
            if where == "before the cycle":
                bench.clock.stall(round(stall_ms * MS))
                skipped.append(bench.cycle().skipped)
            else:
                bench.exchange.begin()
                bench.clock.stall(round(stall_ms * MS))
                bench.exchange.collect()
                bench.exchange.command([b"\0" * 16 for _ in bench.wires])
                skipped.append(bench.cycle().skipped)
        else:
            bench.cycle()
    assert all(stall_ms - 1.5 <= s <= stall_ms + 1 for s in skipped)
    for wire in bench.wires:
        apart = [b - a for a, b in pairwise(wire.syncs)]
        assert min(apart) >= LATEST_START * period
        assert sum(gap > 1.5 * period for gap in apart) == len(skipped)
        kinds = [data == SYNC for _, data in wire.sent]
        assert all(a != b for a, b in pairwise(kinds)), "a SYNC and a command in turn, whatever was missed"
        assert {(at - wire.syncs[0]) % period for at in wire.syncs[-10:]} == {0}


@pytest.mark.parametrize("step_s", [-3600.0, -0.5, 0.5, 3600.0, 1e9])
def test_a_step_of_the_clock_reaches_neither_the_rhythm_nor_the_recording(bench: Bench, step_s: float) -> None:
    period = bench.exchange.period_ns
    stamps = []
    for k in range(CYCLES):
        if k == CYCLES // 2:
            bench.clock.calendar += round(step_s * 1e9)
        begun = bench.cycle()
        assert begun.skipped == 0
        stamps.append(begun.time_ns)
    assert {b - a for a, b in pairwise(stamps)} == {period}
    assert {b - a for a, b in pairwise(bench.wires[0].syncs)} == {period}
    assert all(at - stamps[0] < CYCLES * period for _, _, at, _ in bench.exchange.take_batches())
