"""Cycles as the loop publishes them, made up: real TPDO and sensor bytes around random measurements."""

from __future__ import annotations

import contextlib
import math
import multiprocessing
import struct
from collections.abc import Callable, Iterator
from itertools import count
from pathlib import Path

import numpy as np
import pytest

from config import Installation, load_installation
from config.schema import WrenchSensor
from driver.cia402.mapping import SYNCHRONOUS
from driver.cia402.pdo import SYNC, PdoCodec
from driver.cyclic.cycle import Cycle, LoopState, RawFrame
from driver.wrench.crc import crc16_modbus, crc16_x25
from virtual_hw.faults import FaultScript
from virtual_hw.standin import run_standin

START_NS = 1_700_000_000_000_000_000
CycleMaker = Callable[..., list[Cycle]]


@pytest.fixture(scope="session")
def dda() -> Installation:
    return load_installation("dda")


@pytest.fixture(scope="session")
def bota_sensor() -> WrenchSensor:
    return WrenchSensor(
        name="wrist", protocol="bota", port="pty:wrist", frame="tool", rate_hz=1000, range_n=500, range_nm=20
    )


@pytest.fixture(scope="session")
def robotiq_sensor() -> WrenchSensor:
    return WrenchSensor(
        name="wrist", protocol="robotiq", port="pty:wrist", frame="tool", rate_hz=100, range_n=300, range_nm=30,
        baud=19200, stale_ms=80,
    )  # fmt: skip


def bota_frame(wrench: tuple[float, ...], time_us: int, status: int = 0, temperature: float = 25.0) -> bytes:
    body = struct.pack("<H6fIf", status, *wrench, time_us % 2**32, temperature)
    return b"\xaa" + body + struct.pack("<H", crc16_x25(body))


def robotiq_frame(counts: tuple[int, ...]) -> bytes:
    body = b"\x20\x4e" + struct.pack("<6h", *counts)
    return body + struct.pack("<H", crc16_modbus(body))


@pytest.fixture(scope="session")
def frame_of() -> dict[str, Callable[..., bytes]]:
    """Encoders of sensor frames, written against the manual and apart from the parsers."""
    return {"bota": bota_frame, "robotiq": robotiq_frame}


@pytest.fixture(scope="session")
def make_cycles() -> CycleMaker:
    return _make_cycles


def _make_cycles(
    installation: Installation, number: int, *, seed: int = 0, lost_share: float = 0.0, late_share: float = 0.0
) -> list[Cycle]:
    """``lost_share`` of the TPDOs never arrive, ``late_share`` arrive before the next cycle's SYNC."""
    rng = np.random.default_rng(seed)
    codec = PdoCodec(installation, "csp")
    buses = [bus.name for bus in installation.bus]
    sensor_bytes = _sensor_bytes(rng)
    late: list[RawFrame] = []
    cycles = []
    for k in range(number):
        now = START_NS + k * installation.cycle.period_ns
        frames, late = late, []
        codec.begin_cycle(now)
        frames += [RawFrame(bus, now, True, bytes(SYNC)) for bus in range(len(buses))]
        for joint, maps in zip(installation.joint, codec.maps, strict=True):
            bus = buses.index(joint.bus)
            for pdo in maps:
                values = rng.integers(-1000, 1000, 4, dtype="<i2")
                # Halves are temperatures that a motor may have, in tenths of a degree.
                data = (values if pdo.transmission == SYNCHRONOUS else values // 2).tobytes()[: pdo.length]
                frame = struct.pack("<IB3x8s", pdo.cob_id, pdo.length, data)
                chance = rng.random()
                if pdo.receive or chance >= lost_share + late_share:
                    frames.append(RawFrame(bus, now + 400_000, pdo.receive, frame))
                    if not pdo.receive:
                        codec.receive(bus, frame, len(frame))
                elif chance >= lost_share:
                    late.append(RawFrame(bus, now + 900_000, False, frame))
        measured = codec.feedback()
        joints = len(installation.joint)
        wanted = [tuple(rng.normal(size=joints).tolist()) for _ in range(4)]
        cycles.append(
            Cycle(
                index=k,
                time_ns=now,
                state=LoopState.PLAYING,
                late_ns=0,
                valid=tuple(measured.valid),
                q=tuple(measured.q),
                dq=tuple(measured.dq),
                tau=tuple(measured.tau),
                q_d=wanted[0],
                dq_d=wanted[1],
                tau_command=wanted[2],
                tau_ff=wanted[3],
                run=1,
                wrench=None,
                frames=tuple(frames),
                serial=tuple((s, next(sensor_bytes)) for s in range(len(installation.wrench_sensor))),
                events=(f"cycle {k}: Drehmoment überschritten",) if k % 50 == 0 else (),
            )
        )
    assert not any(math.isnan(v) for c in cycles for v in c.q) or lost_share or late_share
    return cycles


def _sensor_bytes(rng: np.random.Generator) -> Iterator[bytes]:
    """A SensONE's line cut at every cycle, wherever a frame happens to be."""
    pending = b""
    for k in count():
        pending += bota_frame(tuple(rng.normal(size=6)), 1000 * k)
        cut = int(rng.integers(0, len(pending) + 1))
        yield pending[:cut]
        pending = pending[cut:]


@contextlib.contextmanager
def _stand_in(
    installation: Installation,
    run_dir: Path,
    *,
    lockstep: bool = True,
    seed: int = 1,
    faults: FaultScript | None = None,
) -> Iterator[int]:
    """The arm's stand-in in a process of its own; gives its process id."""
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    process = context.Process(
        target=run_standin, args=(installation, None, lockstep, seed, ready.set, run_dir, faults), daemon=True
    )
    process.start()
    try:
        assert ready.wait(60), "the stand-in did not come up"
        assert process.pid is not None
        yield process.pid
    finally:
        process.terminate()
        process.join()


@pytest.fixture(scope="session")
def stand_in() -> Callable[..., contextlib.AbstractContextManager[int]]:
    """``with stand_in(installation, run_dir, lockstep=True, seed=1) as pid``."""
    return _stand_in
