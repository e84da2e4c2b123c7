"""The usual cycle in closed form and the frame-by-frame simulation of the bus tell the same bytes."""

from __future__ import annotations

from collections.abc import Callable
from contextlib import AbstractContextManager
from pathlib import Path

import pytest

from config import load_installation
from config.schema import Mode
from driver.arm import ArmLoop
from driver.cyclic.ring import RingReader
from driver.plan import Plan
from virtual_hw.faults import FaultScript
from virtual_hw.faults.drives import DriveFault

StandIn = Callable[..., AbstractContextManager[int]]
NEVER = FaultScript(fault=(DriveFault(kind="drive_fault", joint="joint1", code=0x2310, delay_ms=1e12),))
"""With any script the bus is simulated frame by frame."""


def session(arm_name: str, mode: Mode, faults: FaultScript | None, stand_in: StandIn, run_dir: Path) -> list[bytes]:
    """Every cycle, as bytes, of commissioning, enabling, a small motion and disabling."""
    installation = load_installation(arm_name)
    run_dir.mkdir()
    with pytest.MonkeyPatch.context() as patch, stand_in(installation, run_dir, seed=5, faults=faults):
        patch.setenv("ETUDE_RUN", str(run_dir))
        with (
            ArmLoop.start(installation, lockstep=True, ring_name="usual") as arm,
            RingReader("usual", from_start=True) as reader,
        ):
            arm.enable(mode)
            status = arm.status()
            s = [3 * u**2 - 2 * u**3 for u in (k / 119 for k in range(120))]
            q = [[a + 0.02 * x for a in status.q_d] for x in s]
            rest = [[0.0] * len(status.q_d)] * 120
            arm.wait(arm.play(Plan(q=q, dq=rest, ddq=rest, mode=mode, controller="pd+ff")))
            arm.disable()
            lost, slots = reader.take(1_000_000)
    assert lost == 0
    return slots


@pytest.mark.parametrize(("arm", "mode"), [("dda", "csp"), ("seven", "cst"), ("puma600", "csp")])
def test_the_usual_cycle_tells_the_bytes_of_the_simulated_bus(
    arm: str, mode: Mode, stand_in: StandIn, tmp_path: Path
) -> None:
    usual, simulated = (
        session(arm, mode, faults, stand_in, tmp_path / name)
        for name, faults in (("usual", None), ("simulated", NEVER))
    )
    assert len(usual) == len(simulated) > 200
    different = [k for k, (a, b) in enumerate(zip(usual, simulated, strict=True)) if a != b]
    assert not different, f"{len(different)} cycles differ, the first is {different[0]}"
