"""Motions, stops and faults in turn in virtual time: every frame accounted for, one clock, memory flat.

A second controller on each bus hears what passes there, and is compared with what the loop says has passed. In full it
is an hour of virtual time; what it saw is printed (pytest -s).
"""

from __future__ import annotations

import gc
import itertools
import os
from collections import Counter, deque
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from config import Installation, load_installation
from driver.bus.channel import RECEIVE_BYTES, Channel, open_channel
from driver.bus.frames import FRAME_BYTES
from driver.cyclic.cycle import LoopState
from tests.faults.bench import Bench, Published, commissioned, standing_in

pytestmark = pytest.mark.timeout(7200)
FULL = os.environ.get("ETUDE_FAULTS") == "full"
SECONDS = 3600.0 if FULL else 11.0
WARM = 0.25
"""Share of the run after which memory is expected to be flat."""
GROWN_KB = 4096
"""From then on, at most, however long it goes on."""
FAULT_EVERY_MS = 1309.0
"""No multiple of a round's length: faults strike in every phase of it."""
TOLD_EVERY_S = 60.0
ENDS = 500
DRAWN_UP_EVERY = 10
"""Cycles from which the account is drawn up together."""
CONFIGURES = frozenset((0, *range(0x580, 0x680)))
"""NMT and SDO: between the configuring master and the drives, not of the cycle."""
FAULTS: tuple[dict[str, Any], ...] = (
    {"kind": "drive_fault", "joint": "joint2", "code": 0x3210, "duration_ms": 5.0},
    {"kind": "frame_doubled", "joint": "joint1", "frame": "feedback", "duration_ms": 50.0},
    {"kind": "wrench_bytes_lost", "sensor": "wrist", "duration_ms": 50.0},
    {"kind": "frame_lost", "joint": "joint3", "frame": "feedback", "only_first": True, "duration_ms": 5.0},
    {"kind": "safe_torque_off", "joint": "joint3", "duration_ms": 30.0},
    {"kind": "wrench_stall", "sensor": "wrist", "duration_ms": 100.0},
    {"kind": "encoder", "joint": "joint1", "how": "jump", "rad": 0.3, "duration_ms": 5.0},
    {"kind": "wrench_crc", "sensor": "wrist", "duration_ms": 50.0},
)
"""In turn. None keeps a frame from the bus that the loop has sent, and none takes a drive's configuration."""


class Account:
    """Of each bus: frames that the loop told of less those that another controller on it has heard. What both have
    is forgotten, so it is as long as the difference."""

    def __init__(self, installation: Installation) -> None:
        self.open: list[dict[bytes, int]] = [{} for _ in installation.bus]
        self.passed = [0 for _ in installation.bus]
        self.steps: Counter[int] = Counter()
        self.cycles = self.samples = 0
        self.first_ages_ns: list[int] = []
        """Of wrench samples when the loop used them: the first, and the newest."""
        self.last_ages_ns: deque[int] = deque(maxlen=ENDS)
        self._last_ns: int | None = None

    def take(self, cycles: list[Published]) -> None:
        """What the loop published; it is forgotten, as the recorder does."""
        for cycle in cycles:
            self.cycles += 1
            if self._last_ns is not None:
                self.steps[cycle.time_ns - self._last_ns] += 1
            self._last_ns = cycle.time_ns
            for bus, _, _, data in cycle.batches:
                frames = frames_in(data)
                self.passed[bus] += len(frames)
                _count(self.open[bus], frames, 1)
            if cycle.wrench is not None and cycle.wrench.fresh:
                self.samples += 1
                age = cycle.time_ns - cycle.wrench.stamp_ns
                self.last_ages_ns.append(age)
                if len(self.first_ages_ns) < ENDS:
                    self.first_ages_ns.append(age)
        cycles.clear()

    def heard(self, bus: int, data: bytes) -> None:
        """What the other controller received."""
        _count(self.open[bus], frames_in(data), -1)

    def unaccounted(self, bus: int) -> int:
        """Frames that only one of the two knows of."""
        return sum(map(abs, self.open[bus].values()))


def _count(open_: dict[bytes, int], frames: list[bytes], by: int) -> None:
    for frame in frames:
        left = open_.pop(frame, 0) + by
        if left:
            open_[frame] = left


def frames_in(data: bytes) -> list[bytes]:
    """Each frame, but those that configure."""
    frames = [data[at : at + FRAME_BYTES] for at in range(0, len(data), FRAME_BYTES)]
    return [frame for frame in frames if int.from_bytes(frame[:4], "little") not in CONFIGURES]


def drain(channel: Channel, buffer: bytearray) -> bytes:
    """All that this controller has heard since the last time."""
    heard = b""
    while end := channel.drain(buffer):
        heard += buffer[:end]
    return heard


def resident_kb() -> int:
    gc.collect()
    return int(Path("/proc/self/statm").read_text().split()[1]) * os.sysconf("SC_PAGESIZE") // 1024


def a_round(bench: Bench, number: int) -> str:
    """Enable, play, and end as the number says (to the end or by a stop), or by the fault that comes meanwhile."""
    mode = bench.installation.modes[number % len(bench.installation.modes)]
    if bench.enable(mode) is None:
        bench.play(0.3 if number % 2 else 0.25, 0.8, mode)
        if number % 3 == 1:
            bench.until(lambda: False, 0.2)
            bench.loop.machine.stop("a client asked for it")
        bench.until(lambda: bench.state in (LoopState.HOLDING, LoopState.LATCHED), 8.0)
    ended = bench.state
    if ended is LoopState.HOLDING:
        bench.loop.machine.disable(lambda _: None)
    bench.until(lambda: bench.state in (LoopState.IDLE, LoopState.LATCHED), 8.0)
    if bench.state is LoopState.LATCHED:
        bench.until(lambda: False, 0.2)
        # The next fault may come while this one is acknowledged.
        assert bench.reset() is None or bench.reset() is None
    return ended.name


def test_nothing_is_lost_and_nothing_grows(tmp_path: Path) -> None:
    dda = load_installation("dda")
    # The other mode sets the drives up anew, and with it the exchange; one mode keeps one account.
    dda = dda.model_copy(update={"modes": (dda.modes[0],)})
    count = int(SECONDS * 1e3 / FAULT_EVERY_MS)
    faults = [
        {**fault, "delay_ms": FAULT_EVERY_MS * k}
        for k, fault in zip(range(1, count + 1), itertools.cycle(FAULTS), strict=False)
    ]
    with ExitStack() as stack:
        arm = stack.enter_context(standing_in(dda, faults, tmp_path))
        bench = stack.enter_context(commissioned(dda, arm))
        listeners = [stack.enter_context(open_channel(bus.channel)) for bus in dda.bus]
        buffer = bytearray(RECEIVE_BYTES)
        bench.loop.cycle()
        bench.kept.cycles.clear()
        for listener in listeners:
            drain(listener, buffer)
        account, sizes, endings = Account(dda), list[tuple[float, int]](), Counter[str]()
        inner = bench.loop.cycle

        def draw_up() -> None:
            account.take(bench.kept.cycles)
            for bus, listener in enumerate(listeners):
                account.heard(bus, drain(listener, buffer))

        def cycle() -> None:
            inner()
            if len(bench.kept.cycles) >= DRAWN_UP_EVERY:
                draw_up()

        bench.loop.cycle = cycle  # type: ignore[method-assign]
        began_ns, told = arm.rig.now_ns, 1
        for number in itertools.count():
            endings[a_round(bench, number)] += 1
            seconds = (arm.rig.now_ns - began_ns) / 1e9
            sizes.append((seconds, resident_kb()))
            if seconds > TOLD_EVERY_S * told:
                told += 1
                print(f"{seconds:.0f} s of virtual time, {sizes[-1][1]} kB", flush=True)
            if seconds > SECONDS:
                break
        draw_up()
        begun = Counter(fault.kind for _, fault in arm.injector.begun)  # type: ignore[attr-defined]
        print(
            f"\n{seconds:.0f} s of virtual time, {account.cycles} cycles, rounds {dict(endings)}, faults {dict(begun)}"
        )
        print(
            f"frames {account.passed}, known to one side only {[account.unaccounted(b) for b in range(len(dda.bus))]}"
        )
        print("resident", ", ".join(f"{kb} kB at {s:.0f} s" for s, kb in sizes[:: max(1, len(sizes) // 12)]))
        assert {"HOLDING", "LATCHED"} <= set(endings)
        assert sum(begun.values()) >= count - 1
        for bus, declared in enumerate(dda.bus):
            drives = sum(joint.bus == declared.name for joint in dda.joint)
            # Only at the ends may they differ: commands of the cycle before we listened, and of the last, which are
            # still to go, and what another controller hears a moment sooner or later than the loop.
            assert account.unaccounted(bus) <= 4 * (4 * drives + 2)
            assert account.passed[bus] > account.cycles * (1 + 2 * drives)
        assert set(account.steps) == {dda.cycle.period_ns}, "virtual time went on by one period a cycle"
        assert abs(arm.rig.now_ns - began_ns - account.cycles * dda.cycle.period_ns) <= dda.cycle.period_ns
        assert account.samples > 0.95 * account.cycles * dda.wrench_sensor[0].rate_hz / dda.cycle.rate_hz
        drift = float(np.median(account.last_ages_ns) - np.median(account.first_ages_ns))
        print(f"wrench samples {account.samples}, drift of the sensor's clock against the loop's {drift / 1e3:.0f} us")
        assert abs(drift) < 200_000, "the sensor's clock stays with the loop's"
        flat_from = min(kb for s, kb in sizes if s > WARM * seconds)
        assert sizes[-1][1] - flat_from < GROWN_KB, f"{sizes[-1][1] - flat_from} kB grown"
