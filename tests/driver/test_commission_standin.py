"""Commissioning the stand-in arm in lockstep and in wall-clock time, and cycles through the channels afterwards."""

from __future__ import annotations

import math
import multiprocessing
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import canopen
import pytest

from config import load_installation
from config.schema import Mode
from driver.bus.channel import RECEIVE_BYTES, open_channel
from driver.bus.frames import Frame, MarkKind, iter_frames, pack_mark
from driver.bus.python_can import LocalBus
from driver.cia402.commission import commission, inspect
from driver.cia402.emergencies import Emergency, decode_emergency
from driver.cia402.pdo import SYNC, PdoCodec, heartbeat
from driver.cia402.states import State, controlword_towards, state_of
from virtual_hw.standin import run_standin

DDA = load_installation("dda")


@contextmanager
def stand_in(run_dir: Path, *, lockstep: bool) -> Iterator[Path]:
    """The direct drive arm's stand-in in a process of its own, for as long as it is needed."""
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    process = context.Process(target=run_standin, args=(DDA, None, lockstep, 1, ready.set, run_dir), daemon=True)
    process.start()
    try:
        assert ready.wait(60), "the stand-in did not come up"
        yield run_dir
    finally:
        process.terminate()
        process.join()


@pytest.fixture(scope="module")
def lockstep_dir(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with stand_in(tmp_path_factory.mktemp("lockstep"), lockstep=True) as run_dir:
        yield run_dir


@pytest.fixture(scope="module")
def wall_clock_dir(tmp_path_factory: pytest.TempPathFactory) -> Iterator[Path]:
    with stand_in(tmp_path_factory.mktemp("wall"), lockstep=False) as run_dir:
        yield run_dir


@pytest.fixture(params=["lockstep_dir", "wall_clock_dir"])
def run_dir(request: pytest.FixtureRequest) -> Path:
    path: Path = request.getfixturevalue(request.param)
    return path


def test_both_modes_one_after_the_other(run_dir: Path) -> None:
    reports = inspect(DDA, run_dir=run_dir)
    assert [report.joint for report in reports] == list(DDA.joint_names)
    modes: tuple[Mode, ...] = ("csp", "cst", "csp")
    for mode in modes:
        done = commission(DDA, mode, run_dir=run_dir)
        assert done.mode == mode
        assert [report.state for report in done.drives] == [State.SWITCH_ON_DISABLED] * 3


def test_canopen_reads_the_stand_in_through_the_plug_in(run_dir: Path) -> None:
    name = DDA.bus[0].channel.partition(":")[2]
    network = canopen.Network(LocalBus(name, run_dir=run_dir))
    network.NOTIFIER_CYCLE = 0.02
    network.connect()
    try:
        node = network.add_node(1, str(DDA.drive_of(DDA.joint[0]).eds))
        assert node.sdo[0x1018][2].raw == DDA.drive_of(DDA.joint[0]).identity.product_code
        assert node.sdo["Manufacturer device name"].raw == "Etude 402"
    finally:
        network.disconnect()


@pytest.mark.parametrize("mode", ["csp", "cst"])
def test_the_arm_is_enabled_in_lockstep(lockstep_dir: Path, mode: Mode) -> None:
    done = commission(DDA, mode, run_dir=lockstep_dir)
    codec = PdoCodec(DDA, mode)
    with ExitStack() as stack:
        channels = [stack.enter_context(open_channel(b.channel, run_dir=lockstep_dir)) for b in DDA.bus]
        window, buffer = 500_000, bytearray(RECEIVE_BYTES)
        now = max(channel.hello_ns or 0 for channel in channels)
        frames: list[bytes] = [b""] * len(channels)
        start: list[float] = []
        for cycle in range(100):
            now += DDA.cycle.period_ns
            ticks = pack_mark(MarkKind.TICK, now) + SYNC + pack_mark(MarkKind.TICK, now + window)
            for bus in reversed(range(len(channels))):
                channels[bus].send(frames[bus] + ticks)
            codec.begin_cycle(now)
            for bus, channel in enumerate(channels):
                codec.receive(bus, buffer, channel.wait_mark(now + window, buffer))
            assert codec.complete, f"cycle {cycle}"
            feedback = codec.feedback()
            start = start or feedback.q
            states = [state_of(word) for word in feedback.statusword]
            words = [controlword_towards(s, State.OPERATION_ENABLED) or 0 for s in states if s]
            beat = heartbeat(done.master_node)
            frames = [bytes(block) + beat for block in codec.encode(words, start, [0.0] * 3, [0.0] * 3)]
    assert states == [State.OPERATION_ENABLED] * 3
    assert all(math.isfinite(value) for value in feedback.q + feedback.dq + feedback.tau)
    if mode == "csp":
        assert feedback.q == pytest.approx(start, abs=0.05)


def test_drives_stop_when_the_host_is_silent(wall_clock_dir: Path) -> None:
    """The supervision that commissioning has set up works: after the host's first heartbeat, silence is a fault."""
    done = commission(DDA, "csp", run_dir=wall_clock_dir)
    with open_channel(DDA.bus[0].channel, run_dir=wall_clock_dir) as channel:
        channel.send(heartbeat(done.master_node))
        buffer, end = bytearray(RECEIVE_BYTES), time.monotonic() + 30
        emergencies: list[Emergency] = []
        while time.monotonic() < end and not emergencies:
            heard = iter_frames(buffer[: channel.drain(buffer)])
            emergencies += [decode_emergency(*f) for f in heard if isinstance(f, Frame) and f.can_id == 0x081]
            time.sleep(0.01)
    assert [emergency.code for emergency in emergencies] == [0x8130]
    # Only a reset of the communication helps; commissioning does one, and all drives are well again.
    again = commission(DDA, "csp", run_dir=wall_clock_dir)
    assert [report.node_id for report in again.drives] == [1, 2, 3]
