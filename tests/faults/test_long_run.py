"""Motions, stops and faults in turn in virtual time: every frame accounted for, one clock, memory flat.

A second controller on each bus hears what passes there, and is compared with what the loop says has passed.
"""

from __future__ import annotations

import gc
import os
from collections import Counter
from contextlib import ExitStack
from pathlib import Path

import numpy as np
import pytest

from config import Installation, load_installation
from driver.bus.channel import RECEIVE_BYTES, Channel, open_channel
from driver.bus.frames import FRAME
from driver.cyclic.cycle import LoopState
from tests.faults.bench import Bench, Published, commissioned, standing_in

pytestmark = pytest.mark.timeout(1800)
ROUNDS = 150 if os.environ.get("ETUDE_FAULTS") == "full" else 6
WARM = 3
"""Rounds after which memory is expected to be flat."""
GROWTH_KB_A_ROUND = 100
FAULT_EVERY_MS = 2600.0
CONFIGURES = range(0x580, 0x680)
"""SDO: between the configuring master and the drives, not of the cycle."""


class Listener:
    """Counts the frames of one bus as another controller on it hears them."""

    def __init__(self, channel: Channel) -> None:
        self._channel, self._buffer = channel, bytearray(RECEIVE_BYTES)
        self.heard: Counter[tuple[int, bytes]] = Counter()

    def drain(self) -> None:
        while end := self._channel.drain(self._buffer):
            self.heard.update(frames_in(bytes(self._buffer[:end])))


def frames_in(data: bytes) -> list[tuple[int, bytes]]:
    """(identifier, data) of each frame, but those that configure."""
    return [(can_id, bytes(d[:n])) for can_id, n, d in FRAME.iter_unpack(data) if can_id not in CONFIGURES and can_id]


def resident_kb() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") // 1024


class Account:
    """Takes what the loop published and forgets it, as the recorder does."""

    def __init__(self, installation: Installation) -> None:
        self.passed: list[Counter[tuple[int, bytes]]] = [Counter() for _ in installation.bus]
        self.steps: Counter[int] = Counter()
        self.cycles = 0
        self.samples = 0
        self.stamp_ages_ns: list[int] = []
        self._last_ns: int | None = None

    def take(self, cycles: list[Published]) -> None:
        for cycle in cycles:
            self.cycles += 1
            if self._last_ns is not None:
                self.steps[cycle.time_ns - self._last_ns] += 1
            self._last_ns = cycle.time_ns
            for bus, _, _, data in cycle.batches:
                self.passed[bus].update(frames_in(data))
            if cycle.wrench is not None and cycle.wrench.fresh:
                self.samples += 1
                self.stamp_ages_ns.append(cycle.time_ns - cycle.wrench.stamp_ns)
        cycles.clear()


def a_round(bench: Bench, number: int) -> str:
    """Enable, play, and end as the number says: to the end, by a stop, or by what the script of faults brings."""
    mode = bench.installation.modes[number % len(bench.installation.modes)]
    assert bench.enable(mode) is None
    bench.play(0.3 if number % 2 else 0.25, 0.8, mode)
    if number % 3 == 1:
        bench.until(lambda: False, 0.2)
        bench.loop.machine.stop("a client asked for it")
    bench.until(lambda: bench.state in (LoopState.HOLDING, LoopState.LATCHED), 8.0)
    ended = bench.state
    if ended is LoopState.HOLDING:
        bench.loop.machine.disable(lambda _: None)
        bench.until(lambda: bench.state is LoopState.IDLE, 8.0)
    else:
        bench.until(lambda: False, 0.2)
        assert bench.reset() is None
    return ended.name


def test_nothing_is_lost_and_nothing_grows(tmp_path: Path) -> None:
    dda = load_installation("dda")
    # The other mode sets the drives up anew, and with it the exchange; one mode keeps one account.
    dda = dda.model_copy(update={"modes": (dda.modes[0],)})
    faults = [
        {"kind": "drive_fault", "joint": "joint2", "code": 0x3210, "delay_ms": FAULT_EVERY_MS * k} for k in range(1, 3)
    ] + [{"kind": "frame_doubled", "frame": "feedback", "joint": "joint1", "delay_ms": 500.0, "duration_ms": 50.0}]
    with ExitStack() as stack:
        arm = stack.enter_context(standing_in(dda, faults, tmp_path))
        bench = stack.enter_context(commissioned(dda, arm))
        listeners = [Listener(stack.enter_context(open_channel(bus.channel))) for bus in dda.bus]
        bench.loop.cycle()
        bench.kept.cycles.clear()
        for listener in listeners:
            listener.drain()
            listener.heard.clear()
        account, sizes, endings = Account(dda), list[int](), Counter[str]()
        inner = bench.loop.cycle

        def cycle() -> None:
            inner()
            account.take(bench.kept.cycles)
            for listener in listeners:
                listener.drain()

        bench.loop.cycle = cycle  # type: ignore[method-assign]
        began_ns = arm.rig.now_ns
        for number in range(ROUNDS):
            endings[a_round(bench, number)] += 1
            sizes.append(resident_kb())
        assert set(endings) == {"HOLDING", "LATCHED"}
        for bus, listener, passed in zip(dda.bus, listeners, account.passed, strict=True):
            heard, drives = listener.heard, sum(joint.bus == bus.name for joint in dda.joint)
            # Only at the ends may they differ: commands of the cycle before we listened, and of the last, which are
            # still to go, and what another controller hears a moment sooner or later than the loop.
            ends = 2 * (4 * drives + 2)
            assert sum((heard - passed).values()) <= ends
            assert sum((passed - heard).values()) <= ends
            assert sum(passed.values()) > account.cycles * (1 + 2 * drives)
        assert set(account.steps) == {dda.cycle.period_ns}, "virtual time went on by one period a cycle"
        assert abs(arm.rig.now_ns - began_ns - account.cycles * dda.cycle.period_ns) <= dda.cycle.period_ns
        assert account.samples > 0.95 * account.cycles * dda.wrench_sensor[0].rate_hz / dda.cycle.rate_hz
        ages = np.array(account.stamp_ages_ns)
        assert abs(np.median(ages[-500:]) - np.median(ages[:500])) < 200_000, "the sensor's clock stays with the loop's"
        grown = (sizes[-1] - sizes[WARM - 1]) / (ROUNDS - WARM)
        assert grown < GROWTH_KB_A_ROUND + 4096 / (ROUNDS - WARM), f"{grown:.0f} kB a round"
