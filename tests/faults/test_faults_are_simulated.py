"""The closed form of the usual cycle never runs where something is to go wrong: faults act on simulated frames."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import ExitStack
from pathlib import Path
from typing import Any

import pytest

from config import Installation, load_installation
from driver.bus.channel import open_channel
from tests.faults.bench import Bench, StandIn, commissioned, standing_in
from virtual_hw.usual_cycle import UsualCycle

FAULT = {"kind": "frame_lost", "joint": "joint2", "frame": "feedback", "after": "enabled", "delay_ms": 1e6}
CYCLES = 40


@pytest.fixture
def usual(monkeypatch: pytest.MonkeyPatch) -> list[bool]:
    """Of each cycle of the stand-in: whether the closed form ran it."""
    ran: list[bool] = []
    inner: Callable[[UsualCycle], int | None] = UsualCycle.run

    def run(cycle: UsualCycle) -> int | None:
        end_ns = inner(cycle)
        ran.append(end_ns is not None)
        return end_ns

    monkeypatch.setattr(UsualCycle, "run", run)
    return ran


def cycled(installation: Installation, arm: StandIn, stack: ExitStack) -> Bench:
    bench = stack.enter_context(commissioned(installation, arm))
    for _ in range(CYCLES):
        bench.loop.cycle()
    return bench


def bare(arm: StandIn, installation: Installation, *, script: bool) -> None:
    """Take away what the bench itself watches, and the injector unless it is asked about."""
    kept = [arm.injector._tick] if script else []
    arm.rig.at_ticks[:] = [act for act in arm.rig.at_ticks if act in kept]
    assert len(arm.rig.at_ticks) == script


@pytest.mark.parametrize("script", [False, True], ids=["no script", "a script whose fault is far off"])
def test_a_fault_script_leaves_every_cycle_to_the_simulation(script: bool, usual: list[bool], tmp_path: Path) -> None:
    dda = load_installation("dda")
    faults: list[dict[str, Any]] = [FAULT] if script else []
    with ExitStack() as stack:
        arm = stack.enter_context(standing_in(dda, faults, tmp_path))
        bare(arm, dda, script=script)
        cycled(dda, arm, stack)
    assert len(usual) >= CYCLES // 2, "the plant hardly moved"
    assert any(usual) is not script


def test_another_node_on_the_bus_does_so_too(usual: list[bool], tmp_path: Path) -> None:
    dda = load_installation("dda")
    with ExitStack() as stack:
        arm = stack.enter_context(standing_in(dda, [], tmp_path))
        bare(arm, dda, script=False)
        bench = cycled(dda, arm, stack)
        assert any(usual)
        stack.enter_context(open_channel(dda.bus[1].channel))
        bench.loop.cycle()
        before = len(usual)
        for _ in range(CYCLES):
            bench.loop.cycle()
        assert not any(usual[before:]) and len(usual) > before
