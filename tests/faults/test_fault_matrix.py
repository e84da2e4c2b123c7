"""Every fault of the matrix is seen in time, stops the arm where it must, and leaves nothing unsafe behind."""

from __future__ import annotations

import pytest

from config import Installation, load_installation
from driver.bus.channel import open_channel
from driver.cyclic.cycle import LoopState
from tests.faults.bench import commissioned, standing_in
from tests.faults.matrix import run
from tests.faults.scenarios import SCENARIOS, Scenario
from virtual_hw.drive.states import PowerState

SAFE_WITHIN_MS = 20


@pytest.fixture(scope="module")
def dda() -> Installation:
    return load_installation("dda")


def _name(scenario: Scenario) -> str:
    return f"{scenario.family}: {scenario.name}"


@pytest.mark.parametrize("scenario", SCENARIOS, ids=_name)
def test_fault(scenario: Scenario, dda: Installation) -> None:
    seen = run(dda, scenario)
    assert not seen.problems, f"{seen.problems}; it said: {seen.sentence}"


def test_scenarios_are_told_apart() -> None:
    assert len({_name(s) for s in SCENARIOS}) == len(SCENARIOS) >= 60


@pytest.mark.parametrize("scenario", [*SCENARIOS[1::37], SCENARIOS[-1]], ids=_name)
def test_repeated_to_the_bit(scenario: Scenario, dda: Installation) -> None:
    assert run(dda, scenario).digest == run(dda, scenario).digest


@pytest.mark.parametrize("mode", ["csp", "cst"])
def test_a_host_that_dies_leaves_safe_drives_within_20_ms(mode: str, dda: Installation, tmp_path) -> None:  # type: ignore[no-untyped-def]
    with standing_in(dda, [], tmp_path) as arm:
        with commissioned(dda, arm) as bench:
            assert bench.enable(mode) is None  # type: ignore[arg-type]
            bench.play(0.8, 0.7, mode)  # type: ignore[arg-type]
            bench.until(lambda: False, 0.35)
            assert bench.state is LoopState.PLAYING
        # Its sockets are closed, as the kernel does for a killed process; time goes on without it.
        died_ns = arm.rig.now_ns
        with open_channel(dda.bus[0].channel) as clock:
            buffer = bytearray(1 << 20)
            for ms in range(1, SAFE_WITHIN_MS + 1):
                clock.tick(died_ns + ms * 1_000_000)
                clock.wait_mark(died_ns + ms * 1_000_000, buffer)
            assert all(node.axis.state is not PowerState.OPERATION_ENABLED for node in arm.rig.nodes)
            for ms in range(SAFE_WITHIN_MS + 1, 1500):
                clock.tick(died_ns + ms * 1_000_000)
                clock.wait_mark(died_ns + ms * 1_000_000, buffer)
        assert arm.speed_rad_s < 0.02
