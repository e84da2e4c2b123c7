"""However the loop's conversation ends, the arm ends at rest with its drives off."""

from __future__ import annotations

import os
import signal
import subprocess
import sys
import textwrap
import time
from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from config import InputError, Installation
from driver.arm import ArmLoop
from driver.cyclic.cycle import Cycle, LoopState
from driver.cyclic.ring import RingReader, ring_path
from driver.plan import Plan

StandIn = Callable[..., AbstractContextManager[int]]
PATIENCE_S = 60.0


@pytest.fixture
def stand_in_pid(
    dda: Installation, stand_in: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[int]:
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path))
    with stand_in(dda, tmp_path) as pid:
        yield pid


def long_move(arm: ArmLoop, seconds: float = 4.0) -> Plan:
    start = np.array(arm.status().q_d)
    s = np.linspace(0.0, 1.0, round(seconds * 1000))[:, None]
    by = np.array([-0.8, 0.6, 0.8])
    return Plan(
        q=start + (10 * s**3 - 15 * s**4 + 6 * s**5) * by,
        dq=(30 * s**2 - 60 * s**3 + 30 * s**4) * by / seconds,
        ddq=(60 * s - 180 * s**2 + 120 * s**3) * by / seconds**2,
    )


def wait_until(condition: Callable[[], bool]) -> None:
    deadline = time.monotonic() + PATIENCE_S
    while not condition():
        assert time.monotonic() < deadline, "it did not come about"
        time.sleep(0.01)


def everything(reader: RingReader) -> list[Cycle]:
    lost, cycles = reader.cycles(limit=1_000_000)
    assert lost == 0
    return cycles


def stopped_in_order(cycles: list[Cycle], cause: str) -> None:
    """Playing, then stopping until the arm is at rest, then off; with the cause in the events."""
    states = [c.state for c in cycles]
    assert states[-1] is LoopState.LATCHED
    assert states.index(LoopState.PLAYING) < states.index(LoopState.STOPPING)
    assert np.abs(cycles[-1].dq).max() < 0.05
    assert any(cause in event for c in cycles for event in c.events)


def test_sigterm_stops_the_moving_arm_first(stand_in_pid: int, dda: Installation) -> None:
    arm = ArmLoop.start(dda, lockstep=True, ring_name="end")
    with RingReader("end", from_start=True) as reader:
        arm.enable("csp")
        run = arm.play(long_move(arm))
        wait_until(lambda: arm.status().progress > 0.05)
        os.kill(arm.pid, signal.SIGTERM)
        wait_until(lambda: not arm.alive)
        stopped_in_order(everything(reader), "SIGTERM")
        with pytest.raises(InputError, match="cyclic loop: its process ended"):
            arm.wait(run)
    arm.close()
    assert not ring_path("end").exists()


def test_the_death_of_the_handles_process_stops_the_moving_arm(stand_in_pid: int) -> None:
    script = textwrap.dedent(
        """
        import importlib.util, os, signal, sys
        from config import load_installation
        from driver.arm import ArmLoop
        spec = importlib.util.spec_from_file_location("endings", sys.argv[1])
        endings = importlib.util.module_from_spec(spec)
        spec.loader.exec_module(endings)
        arm = ArmLoop.start(load_installation("dda"), lockstep=True, ring_name="orphan")
        arm.enable("csp")
        print(arm.pid, flush=True)
        sys.stdin.readline()
        arm.play(endings.long_move(arm))
        endings.wait_until(lambda: arm.status().progress > 0.05)
        os.kill(os.getpid(), signal.SIGKILL)
        """
    )
    holder = subprocess.Popen(
        [sys.executable, "-c", script, __file__], stdin=subprocess.PIPE, stdout=subprocess.PIPE, text=True
    )
    assert holder.stdin is not None and holder.stdout is not None
    with holder:
        loop_pid = int(holder.stdout.readline())
        with RingReader("orphan", from_start=True) as reader:
            holder.stdin.write("go\n")
            holder.stdin.flush()
            holder.wait(PATIENCE_S)
            wait_until(lambda: reader.ended)
            stopped_in_order(everything(reader), "the daemon has gone")
    wait_until(lambda: not Path(f"/proc/{loop_pid}").exists())


def test_closing_a_holding_arm_disables_it(stand_in_pid: int, dda: Installation) -> None:
    with RingReaderOf(dda) as (arm, reader):
        arm.enable("csp")
        arm.close()
        cycles = everything(reader)
    assert cycles[-1].state is LoopState.IDLE
    assert not arm.alive
    arm.close()


class RingReaderOf:
    """A loop and a reader of it."""

    def __init__(self, installation: Installation) -> None:
        self.arm = ArmLoop.start(installation, lockstep=True, ring_name="close")
        self.reader = RingReader("close", from_start=True)

    def __enter__(self) -> tuple[ArmLoop, RingReader]:
        return self.arm, self.reader

    def __exit__(self, *_: object) -> None:
        self.arm.close()
        self.reader.close()


def test_the_loss_of_the_buses_latches_and_a_reset_says_what_is_missing(stand_in_pid: int, dda: Installation) -> None:
    with RingReaderOf(dda) as (arm, _):
        arm.enable("csp")
        run = arm.play(long_move(arm))
        wait_until(lambda: arm.status().progress > 0.05)
        os.kill(stand_in_pid, signal.SIGKILL)
        wait_until(lambda: arm.status().state is LoopState.LATCHED)
        status = arm.wait(run)
        assert status.cause is not None and "the stand-in has left the bus" in status.cause
        assert status.run_outcome == status.cause
        with pytest.raises(InputError, match="local:dda-can"):
            arm.reset()
        after = arm.status()
        assert after.state is LoopState.LATCHED and after.buses == ()


def test_a_loop_that_cannot_start_says_why_and_leaves_nothing_behind(
    dda: Installation, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path))
    with pytest.raises(InputError, match="no stand-in arm is on"):
        ArmLoop.start(dda, lockstep=True, ring_name="none")
    assert not ring_path("none").exists()
