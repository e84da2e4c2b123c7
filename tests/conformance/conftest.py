"""A drive on the bench: one CiA 402 drive at a channel, the stand-in's first or a real one.

    pytest tests/conformance                                                    the stand-in, in lockstep
    pytest tests/conformance --channel socketcan:can0 --node 5 --drive NAME     a real drive, its motor free to turn

A real drive is enabled in cyclic synchronous position at the position it stands at; nothing is stored in it.
"""

from __future__ import annotations

import multiprocessing
import socket
import time
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path

import pytest

from config import Installation, load_installation
from config.loader import load_drive
from config.schema import Bus, Drive, Joint
from driver.bus.channel import RECEIVE_BYTES, open_channel
from driver.bus.frames import Frame, MarkKind, iter_frames, pack, pack_mark
from driver.cia402 import objects
from driver.cia402.mapping import MODE_CODES, pdo_maps
from driver.cia402.nodes import BusNodes, Nmt, NmtState
from driver.cia402.pdo import SYNC
from driver.cia402.pdo_input import pdo_struct
from driver.cia402.remap import remap
from driver.cia402.states import Control, State, controlword_towards, state_of
from virtual_hw.standin import run_standin

PERIOD_NS, WINDOW_NS = 2_000_000, 1_000_000
DEADLINE_MS = 50
STAY_ON_QUICK_STOP, FAULT_ON_LOSS = 6, 1


def pytest_addoption(parser: pytest.Parser) -> None:
    group = parser.getgroup("conformance", "the drive on the bench")
    group.addoption("--channel", help="channel of a real drive, for example socketcan:can0")
    group.addoption("--node", type=int, help="its node id")
    group.addoption("--drive", help="its layout: a name in config/drives")


class Bench:
    """One drive and a host that sends SYNC every 2 ms of the bench's time; PDOs as its layout for CSP says."""

    def __init__(self, channel: str, joint: Joint, drive: Drive, run_dir: Path | None, *, real: bool) -> None:
        self.node_id, self.drive, self.real = joint.node_id, drive, real
        self.nodes = BusNodes(Bus(name="bench", channel=channel), run_dir=run_dir)
        self.sdo = self.nodes.add(joint, drive)
        self.channel = open_channel(channel, run_dir=run_dir)
        self.maps = pdo_maps(joint, drive, "csp")
        self.counts = 0
        self._tpdo = next(pdo for pdo in self.maps if not pdo.receive and "statusword" in pdo.names)
        self._now_ns = self.channel.hello_ns or time.monotonic_ns()
        self._buffer = bytearray(RECEIVE_BYTES)

    def close(self) -> None:
        self.nmt(Nmt.RESET_COMMUNICATION)
        self.channel.close()
        self.nodes.close()

    # ── NMT and configuration ──

    def nmt(self, command: Nmt, node_id: int | None = None) -> None:
        self.channel.send(pack(0x000, bytes((command, self.node_id if node_id is None else node_id))))

    def prepare(self) -> None:
        """From anything to operational in SWITCH_ON_DISABLED: mapped for CSP, faults latch, quick stop stays."""
        self.nodes.command(Nmt.RESET_COMMUNICATION, self.node_id)
        assert self.nodes.wait_for(self.node_id, (NmtState.BOOT_UP,), 5.0), "no boot-up message"
        self.sdo.write(objects.CONTROLWORD, 0, Control.DISABLE_VOLTAGE)
        self.sdo.write_verified(objects.QUICK_STOP_OPTION, 0, STAY_ON_QUICK_STOP)
        self.sdo.write_verified(objects.CONNECTION_LOST_OPTION, 0, FAULT_ON_LOSS)
        self.sdo.write_verified(objects.INTERPOLATION_PERIOD, 1, 2)
        self.sdo.write_verified(objects.INTERPOLATION_PERIOD, 2, -3)
        remap(self.sdo, self.maps, DEADLINE_MS)
        self.sdo.write(objects.MODE, 0, MODE_CODES["csp"])
        self.nmt(Nmt.START)
        self.run(2)
        self.counts = self.sdo.read(0x6064)
        self.go(State.SWITCH_ON_DISABLED)

    # ── cycles ──

    def rpdos(self, controlword: int) -> bytes:
        """All RPDOs: this controlword, the position the axis stands at, nothing else."""
        values = {"controlword": controlword, "target_position": self.counts, "mode": MODE_CODES["csp"]}
        return b"".join(
            pack(
                pdo.cob_id, pdo_struct(pdo, self.drive).pack(*(values.get(name, 0) for name in pdo.names))[: pdo.length]
            )
            for pdo in self.maps
            if pdo.receive
        )

    def run(self, cycles: int, controlword: int | None = None, *, sync: bool = True, extra: bytes = b"") -> list[Frame]:
        """Let cycles pass and return what was heard: RPDOs with ``controlword`` before each SYNC, none when None."""
        heard: list[Frame] = []
        for _ in range(cycles):
            frames = extra + (self.rpdos(controlword) if controlword is not None else b"")
            extra = b""
            self._now_ns += PERIOD_NS
            heard += self._cycle(frames, SYNC if sync else b"")
        return heard

    def _cycle(self, frames: bytes, sync: bytes) -> list[Frame]:
        t, end = self._now_ns, self._now_ns + WINDOW_NS
        if self.channel.lockstep:
            self.channel.send(frames + pack_mark(MarkKind.TICK, t) + sync + pack_mark(MarkKind.TICK, end))
            filled = self.channel.wait_mark(end, self._buffer)
        else:
            if frames:
                self.channel.send(frames)
            self._now_ns = t = max(t, time.monotonic_ns())
            time.sleep(max(0, t - time.monotonic_ns()) * 1e-9)
            if sync:
                self.channel.send(sync)
            time.sleep(WINDOW_NS * 1e-9)
            filled = self.channel.drain(self._buffer)
        return [frame for frame in iter_frames(self._buffer[:filled]) if isinstance(frame, Frame)]

    def statusword(self, heard: list[Frame]) -> int:
        """The newest statusword among these frames."""
        data = [frame.data for frame in heard if frame.can_id == self._tpdo.cob_id]
        assert data, "no TPDO with a statusword came"
        values = pdo_struct(self._tpdo, self.drive).unpack(data[-1].ljust(8, b"\0"))
        return int(values[self._tpdo.names.index("statusword")])

    def state(self) -> State | None:
        """The state over SDO, which works in every NMT state but stopped."""
        return state_of(self.sdo.read(objects.STATUSWORD))

    def settle(self, controlword: int, cycles: int = 40) -> State | None:
        """The state after holding a controlword for a while."""
        return state_of(self.statusword(self.run(cycles, controlword)))

    def go(self, target: State) -> None:
        """Bring the drive to a state by the standard's way; FAULT by leaving it without commands."""
        if target is State.FAULT:
            self.fail()
            return
        for _ in range(1500):
            state = self.state()
            if state is target:
                return
            assert state is not None
            if state is State.FAULT:
                self.reset_fault()
                continue
            word = controlword_towards(state, target)
            if word is None and target is State.QUICK_STOP_ACTIVE:
                word = controlword_towards(state, State.OPERATION_ENABLED)
            # States without a command end by themselves: a fault reaction ramps down first.
            self.run(2, Control.DISABLE_VOLTAGE if word is None else word)
        pytest.fail(f"the drive did not reach {target.value}, it is in {state.value if state else 'no state'}")

    def fail(self) -> None:
        """A fault without harm: the deadline of the RPDOs runs out."""
        self.run(2, Control.DISABLE_VOLTAGE)
        self.run(2 * DEADLINE_MS)
        assert self.state() is State.FAULT, "the drive does not watch over its RPDOs"

    def reset_fault(self) -> None:
        self.run(5, Control.DISABLE_VOLTAGE)
        self.run(5, Control.FAULT_RESET)
        self.run(5, Control.DISABLE_VOLTAGE)

    def forget(self) -> None:
        """Leave what has come so far, the answers to `sdo` among it."""
        self.run(1, sync=False)

    def emergencies(self, heard: list[Frame]) -> list[int]:
        """Error codes of the emergencies among these frames."""
        return [int.from_bytes(f.data[:2], "little") for f in heard if f.can_id == 0x80 + self.node_id]


@contextmanager
def stand_in(installation: Installation, run_dir: Path, *, lockstep: bool) -> Iterator[None]:
    """The direct drive arm's stand-in on the installation's buses."""
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    process = context.Process(
        target=run_standin, args=(installation, None, lockstep, 1, ready.set, run_dir), daemon=True
    )
    process.start()
    try:
        assert ready.wait(60), "the stand-in did not come up"
        yield
    finally:
        process.terminate()
        process.join()


def on_socketcan(installation: Installation) -> Installation:
    """The installation with vcan0, vcan1 … for its buses; skips where this kernel has none."""
    buses = []
    for k, bus in enumerate(installation.bus):
        try:
            with socket.socket(socket.AF_CAN, socket.SOCK_RAW, socket.CAN_RAW) as s:
                s.bind((f"vcan{k}",))
        except OSError as error:
            pytest.skip(f"no CAN interface vcan{k} here ({error}); make test-vcan brings one")
        buses.append(bus.model_copy(update={"channel": f"socketcan:vcan{k}"}))
    return installation.model_copy(update={"bus": tuple(buses)})


@pytest.fixture(scope="module", params=["lockstep", pytest.param("socketcan", marks=pytest.mark.vcan)])
def whole_bench(request: pytest.FixtureRequest, tmp_path_factory: pytest.TempPathFactory) -> Iterator[Bench]:
    """The drive on the bench: a real one where --channel names it, else the stand-in's first, on either bus.

    It leaves the bus with its module: others bring up arms on vcan0 too.
    """
    channel = request.config.getoption("--channel", default=None)
    dda = load_installation("dda")
    joint = dda.joint[0]
    with ExitStack() as stack:
        if channel is None:
            lockstep = request.param == "lockstep"
            dda = dda if lockstep else on_socketcan(dda)
            run_dir = tmp_path_factory.mktemp("bench")
            stack.enter_context(stand_in(dda, run_dir, lockstep=lockstep))
            bench = Bench(dda.bus[0].channel, joint, dda.drive_of(joint), run_dir, real=False)
        elif request.param == "socketcan":
            pytest.skip("a real drive is tested once")
        else:
            node, name = (request.config.getoption(option, default=None) for option in ("--node", "--drive"))
            if node is None or name is None:
                raise pytest.UsageError("--channel needs --node and --drive beside it")
            joint = joint.model_copy(update={"node_id": node, "name": "bench", "drive": name})
            bench = Bench(channel, joint, load_drive(name, Path.cwd()), None, real=True)
        stack.callback(bench.close)
        yield bench


@pytest.fixture
def bench(whole_bench: Bench) -> Bench:
    """The drive, operational, in SWITCH_ON_DISABLED."""
    whole_bench.prepare()
    return whole_bench
