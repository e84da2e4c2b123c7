"""Runs scenarios of the fault matrix and says what was seen."""

from __future__ import annotations

import hashlib
import os
import tempfile
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config import InputError, Installation, load_installation
from config.paths import run_directory
from driver.cyclic.cycle import LoopState
from tests.faults.bench import Bench, StandIn, commands_on_the_wire, commissioned, standing_in
from tests.faults.scenarios import Scenario
from virtual_hw.drive.states import PowerState

MOVE_RAD, MOVE_S = 0.8, 0.7
AFTER_S = 0.4
"""Longer than every watchdog in the drives."""
REST_RAD_S = 0.02


@dataclass(frozen=True)
class Seen:
    """What came of one scenario. ``cycles``: from the fault's beginning to all axes stopping; None when it did not
    come to that. ``travel_rad``: how far any joint still moved after the fault began."""

    scenario: Scenario
    outcome: str
    sentence: str
    by: str
    cycles: int | None
    travel_rad: float
    at_rest: bool
    off: bool
    """Whether every drive is without torque at the end (or the arm holds, when it went on)."""
    kept_frames: int
    kept_nothing_of: tuple[str, ...]
    """Buses and sensors of whose last moments nothing was kept."""
    reset: bool | None
    beyond_limits: str
    """The first command on the wire beyond the joint's limits; empty when there was none."""
    digest: str

    @property
    def problems(self) -> list[str]:
        """What is not as it must be."""
        wanted, found = self.scenario, list[str]()
        if self.outcome != wanted.outcome:
            found.append(f"it {self.outcome}, wanted: {wanted.outcome}")
        if wanted.words and wanted.words not in self.sentence:
            found.append(f"nothing tells of {wanted.words!r}")
        if wanted.outcome == "stops":
            if self.cycles is None or self.cycles > wanted.within:
                found.append(f"seen after {self.cycles} cycles, wanted: at most {wanted.within}")
            if self.kept_nothing_of:
                found.append(f"nothing was kept of {', '.join(self.kept_nothing_of)}")
        if not self.at_rest:
            found.append("the arm is not at rest")
        if not self.off:
            found.append("a drive still has torque")
        if wanted.resets is not None and self.reset is not wanted.resets:
            found.append(f"reset {'succeeded' if self.reset else 'failed'}")
        if self.beyond_limits:
            found.append(self.beyond_limits)
        return found


def run_on_dda(scenario: Scenario) -> Seen:
    """One scenario on the MIT direct drive arm, for a pool of processes."""
    return run(load_installation("dda"), scenario)


def silence() -> None:
    """Keep what the stand-in says of its faults out of the table."""
    os.dup2(os.open(os.devnull, os.O_WRONLY), 2)


def run(installation: Installation, scenario: Scenario) -> Seen:
    """One scenario from power-on to rest."""
    with tempfile.TemporaryDirectory() as directory, standing_in(installation, scenario.faults, Path(directory)) as arm:
        try:
            with commissioned(installation, arm) as bench:
                return _session(bench, arm, scenario)
        except InputError as problem:
            return _refused(arm, scenario, str(problem))


def _refused(arm: StandIn, scenario: Scenario, sentence: str) -> Seen:
    off = all(node.axis.state is not PowerState.OPERATION_ENABLED for node in arm.rig.nodes)
    return Seen(scenario, "refused", sentence, "host", None, 0.0, True, off, 0, (), None, "", _digest(sentence))


def _session(bench: Bench, arm: StandIn, scenario: Scenario) -> Seen:
    problem = bench.enable(scenario.mode)
    if problem is not None:
        bench.until(lambda: bench.state in (LoopState.IDLE, LoopState.LATCHED), 8.0)
        return _refused(arm, scenario, str(problem))
    bench.play(MOVE_RAD, MOVE_S, scenario.mode)
    bench.until(lambda: bench.state in (LoopState.HOLDING, LoopState.LATCHED), MOVE_S + 8.0)
    bench.until(lambda: not bench.loop.connected, AFTER_S)
    stopped = bench.state is LoopState.LATCHED
    status = bench.loop.status()
    events = [event for cycle in bench.kept.cycles for event in cycle.events]
    sentence = bench.loop.machine.cause or "" if stopped else "; ".join(events)
    begun = arm.injector.begun[-1][0] if arm.injector.begun else 0
    at_rest, travel = arm.speed_rad_s < REST_RAD_S, arm.travel_rad
    enabled = [node.axis.state is PowerState.OPERATION_ENABLED for node in arm.rig.nodes]
    reset = None
    if scenario.resets is not None:
        reset = (bench.reset() if stopped else bench.enable_again(scenario.mode)) is None
        reset = reset and bench.until(lambda: not any(s.stale for s in bench.loop.status().sensors), AFTER_S)
    return Seen(
        scenario,
        "stops" if stopped else "goes on",
        sentence,
        _seen_by(sentence),
        _cycles(bench, begun) if stopped else None,
        travel,
        at_rest,
        not any(enabled) if stopped else all(enabled),
        len(status.last_frames),
        _kept_nothing_of(bench.installation, status.last_frames),
        reset,
        _beyond_limits(bench),
        _fingerprint(bench),
    )


def _kept_nothing_of(installation: Installation, lines: Sequence[str]) -> tuple[str, ...]:
    kept = {line.split()[1] for line in lines}
    return tuple(part.name for part in (*installation.bus, *installation.wrench_sensor) if part.name not in kept)


def _cycles(bench: Bench, begun_ns: int) -> int | None:
    period = bench.installation.cycle.period_ns
    for cycle in bench.kept.cycles:
        if cycle.state in (LoopState.STOPPING, LoopState.LATCHED) and cycle.time_ns + period > begun_ns:
            return max(0, -(-(cycle.time_ns - begun_ns) // period)) + 1
    return None


def _seen_by(sentence: str) -> str:
    """A drive's own words begin with its emergency or its state; all else the host found."""
    return "drive" if any(word in sentence for word in ("EMCY", "reports", "left operation")) else "host"


def _beyond_limits(bench: Bench) -> str:
    joints = bench.installation.joint
    for time_ns, i, quantity, value in commands_on_the_wire(bench.installation, bench.kept.cycles):
        low, high = (-joints[i].limits.torque_nm, joints[i].limits.torque_nm)
        if quantity == "position":
            low, high = joints[i].limits.position_rad
        slack = 1.5 * (joints[i].rated_torque_nm / 1000 if quantity == "torque" else 2 * np.pi / 65536)
        if not low - slack <= value <= high + slack:
            return f"{joints[i].name}: {quantity} {value:.4g} was commanded at {time_ns} ns"
    return ""


def _fingerprint(bench: Bench) -> str:
    """Of every byte on the wires and every sentence."""
    return _digest("".join(repr((c.time_ns, c.state, c.batches, c.serial, c.events)) for c in bench.kept.cycles))


def _digest(text: str) -> str:
    # Sentences name sockets and lines by their paths, and each scenario has a run directory of its own.
    return hashlib.sha256(text.replace(str(run_directory()), "").encode()).hexdigest()[:16]
