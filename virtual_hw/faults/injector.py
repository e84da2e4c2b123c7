"""Lets the faults of a script happen at their times."""

from __future__ import annotations

import math
from collections.abc import Callable
from operator import itemgetter

from virtual_hw.drive.states import PowerState
from virtual_hw.faults.fault import Fault, SensorFault, Stage
from virtual_hw.faults.script import FaultScript
from virtual_hw.faults.sensors import require_bota

MOVED_RAD = 0.01
"""A joint that is so far from where it was enabled moves: more than its sag when the brake opens, whereas its speed
shakes by as much as a slow motion's."""


class Injector:
    """Watches the rig before every servo tick; begins and ends faults, and tells of each."""

    def __init__(self, script: FaultScript, stage: Stage, tell: Callable[[str], None]) -> None:
        """Raises InputError when a fault is of a place that the installation does not have."""
        self._stage, self._tell = stage, tell
        for fault in script.fault:
            fault.check(stage)
            if isinstance(fault, SensorFault):
                require_bota(fault, stage.sensor(fault.sensor))
        self._waiting: dict[str, list[Fault]] = {}
        """By the phase that they come after, until it is reached."""
        for fault in script.fault:
            self._waiting.setdefault(fault.after, []).append(fault)
        self._coming: list[tuple[int, Fault]] = []
        """Those whose time is known, and when: the next one last."""
        self._present: list[tuple[Fault, int | None]] = []
        self._reached: set[str] = set()
        self._enabled_at: list[int] = []
        """Counts of each encoder when every drive had been enabled."""
        self.begun: list[tuple[int, Fault]] = []
        """Time in ns and fault, for each that has begun."""
        self._counts_per_rad = [abs(j.encoder.counts_per_turn) / math.tau for j in stage.installation.joint]
        stage.rig.at_ticks.append(self._tick)
        self._reach("start", stage.rig.now_ns)
        self._act(stage.rig.now_ns)

    def _tick(self, now_ns: int) -> None:
        self._look(now_ns)
        self._act(now_ns)

    def _look(self, now_ns: int) -> None:
        nodes, counts = self._stage.rig.nodes, self._stage.rig.power_stage.senses.counts
        if "enabled" not in self._reached:
            if all(node.axis.state is PowerState.OPERATION_ENABLED for node in nodes):
                self._enabled_at = list(counts)
                self._reach("enabled", now_ns)
        elif "moving" not in self._reached:
            moved = zip(counts, self._enabled_at, self._counts_per_rad, strict=True)
            if any(abs(now - then) > MOVED_RAD * k for now, then, k in moved):
                self._reach("moving", now_ns)

    def _reach(self, phase: str, now_ns: int) -> None:
        self._reached.add(phase)
        self._coming += [(now_ns + round(f.delay_ms * 1e6), f) for f in reversed(self._waiting.pop(phase, []))]
        self._coming.sort(key=itemgetter(0), reverse=True)

    def _act(self, now_ns: int) -> None:
        while self._coming and self._coming[-1][0] <= now_ns:
            _, fault = self._coming.pop()
            end_ns = None if fault.duration_ms is None else now_ns + round(fault.duration_ms * 1e6)
            fault.begin(self._stage)
            self._present.append((fault, end_ns))
            self.begun.append((now_ns, fault))
            self._tell(f"fault begins at {now_ns} ns: {_described(fault)}")
        for entry in list(self._present):
            fault, end_ns = entry
            if end_ns is not None and now_ns >= end_ns:
                self._present.remove(entry)
                fault.end(self._stage)
                self._tell(f"fault ends at {now_ns} ns: {_described(fault)}")
            else:
                fault.tick(self._stage, now_ns)


def _described(fault: Fault) -> str:
    """Its keys, apart from when it happens."""
    keys = fault.model_dump(exclude={"after", "delay_ms", "duration_ms"}, exclude_defaults=True)
    return ", ".join(f"{key} {value}" for key, value in {"kind": getattr(fault, "kind", ""), **keys}.items())
