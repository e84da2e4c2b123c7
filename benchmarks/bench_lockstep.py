"""Speed of lockstep, in multiples of real time, beside a bare `mj_step` loop of the same arm.

The best of several windows, of both: what the neighbours on a shared machine take is left out.
"""

from __future__ import annotations

import time

import mujoco

from benchmarks.figure import Figure
from benchmarks.standin import running
from config import load_installation

VIRTUAL_SECONDS = 2.0
WINDOWS = 10


def bare_mujoco_speed(arm: str) -> float:
    """Multiples of real time of `mj_step` alone, one step a cycle of the arm's loop."""
    installation = load_installation(arm)
    spec = mujoco.MjSpec.from_file(str(installation.path.parent / installation.arm.urdf))
    spec.option.timestep = 1 / installation.cycle.rate_hz
    model = spec.compile()
    data = mujoco.MjData(model)
    steps = int(VIRTUAL_SECONDS * installation.cycle.rate_hz)
    least = float("inf")
    for _ in range(WINDOWS):
        start = time.perf_counter()
        for _ in range(steps):
            mujoco.mj_step(model, data)
        least = min(least, time.perf_counter() - start)
    return VIRTUAL_SECONDS / least


def lockstep_speed(arm: str) -> float:
    """Multiples of real time of loop, bus, drives, plant and sensor, with the arm enabled and holding."""
    with running(arm, lockstep=True) as (_, loop, _):
        loop.enable("csp")
        least = float("inf")
        for _ in range(WINDOWS):
            start = time.perf_counter()
            loop.run_for(VIRTUAL_SECONDS)
            least = min(least, time.perf_counter() - start)
    return VIRTUAL_SECONDS / least


def measure() -> list[Figure]:
    return [
        Figure(name, lockstep_speed(arm), "× real time", "bare mj_step loop", bare_mujoco_speed(arm))
        for name, arm in (("lockstep_3axis", "dda"), ("lockstep_7axis", "seven"))
    ]
