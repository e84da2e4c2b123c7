"""The same loop in wall-clock time, slow enough for any machine; nothing here measures time."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from contextlib import AbstractContextManager
from pathlib import Path

import numpy as np
import pytest

from config import Installation
from config.schema import Mode
from driver.arm import ArmLoop
from driver.cyclic.cycle import LoopState
from driver.cyclic.ring import RingReader
from driver.plan import Plan

StandIn = Callable[..., AbstractContextManager[int]]
RATE_HZ = 100.0


@pytest.fixture
def slow_dda(dda: Installation) -> Installation:
    """The direct drive arm at 100 Hz, with patience for a machine that is busy with other tests."""
    timing = dda.cycle.model_copy(update={"rate_hz": RATE_HZ, "heartbeat_ms": 1000, "missed_deadlines_to_stop": 100})
    return dda.model_copy(update={"cycle": timing})


@pytest.fixture
def arm(
    slow_dda: Installation, stand_in: StandIn, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> Iterator[ArmLoop]:
    monkeypatch.setenv("ETUDE_RUN", str(tmp_path))
    with (
        stand_in(slow_dda, tmp_path, lockstep=False),
        ArmLoop.start(slow_dda, lockstep=False, ring_name="wall") as loop,
    ):
        yield loop


@pytest.mark.parametrize("mode", ["csp", "cst"])
def test_enable_play_stop_reset(arm: ArmLoop, slow_dda: Installation, mode: Mode) -> None:
    with RingReader("wall", from_start=True) as reader:
        arm.enable(mode)
        start = np.array(arm.status().q_d)
        s = np.linspace(0.0, 1.0, 100)[:, None]
        by = np.array([0.2, 0.2, 0.2])
        plan = Plan(
            q=start + (10 * s**3 - 15 * s**4 + 6 * s**5) * by,
            dq=(30 * s**2 - 60 * s**3 + 30 * s**4) * by,
            ddq=(60 * s - 180 * s**2 + 120 * s**3) * by,
            mode=mode,
        )
        run = arm.play(plan)
        assert arm.wait(run).run_outcome == "done"
        played = [c for c in reader.cycles(100_000)[1] if c.run == run]
        assert np.array_equal([c.q_d for c in played], plan.q), "skipped cycles delay a motion, and drop nothing of it"
        assert np.nanmax(np.abs(np.array(played[-1].q) - plan.q[-1])) < 0.05
        arm.stop("end of the test")
        status = arm.status()
        assert (status.state, status.cause) == (LoopState.LATCHED, "end of the test")
        arm.reset()
        assert arm.status().state is LoopState.IDLE
