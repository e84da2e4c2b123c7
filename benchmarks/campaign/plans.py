"""What a scenario is to be: which arm, which causes, how large. Drawn from a seed."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.random import Generator

from benchmarks.campaign.arms import ARMS
from benchmarks.campaign.body_causes import BODIES
from benchmarks.campaign.cause import Draw
from benchmarks.campaign.friction_causes import DEGRESSIVE, FRICTION
from benchmarks.campaign.outside_causes import OUTSIDE
from benchmarks.campaign.sensor_causes import LATE_ANGLES, SENSORS
from benchmarks.campaign.transmission_causes import FINE_LINES, TRANSMISSION

CATALOGUE: dict[str, Draw] = {**FRICTION, **TRANSMISSION, **SENSORS, **BODIES}
ASKED_FOR: dict[str, Draw] = {**DEGRESSIVE, **FINE_LINES, **LATE_ANGLES}
"""Drawn where they are asked for alone."""
ALL = {**CATALOGUE, **OUTSIDE, **ASKED_FOR}
SCATTER = (0.0, 0.02, 0.05)


@dataclass(frozen=True)
class Plan:
    """What a scenario is to be. ``kinds`` are keys of `ALL`, ``size`` of each in multiples of the noise; ``friction``
    of every joint beside them, likewise; ``rests``: the motions go from point to point, and rest in each;
    ``drives_off_s`` for which the torques are recorded with the drives off, too."""

    number: int
    seed: int
    arm: str
    kinds: tuple[str, ...] = ()
    size: float = 0.0
    scatter: float = 0.05
    seconds: float = 60.0
    friction: float = 0.0
    rests: bool = False
    drives_off_s: float = 0.0

    @property
    def name(self) -> str:
        """Of its folder, where it is kept."""
        kinds = "+".join(self.kinds).replace(":", "-") or "clean"
        told = f"{self.seed}-{self.number:04d}-{self.arm}-{kinds}-{self.size:g}-{self.scatter:g}-{self.seconds:g}s"
        told += f"-friction-{self.friction:g}" if self.friction else ""
        told += "-rests" if self.rests else ""
        return f"{told}-off-{self.drives_off_s:g}s" if self.drives_off_s else told


def draw_plans(count: int, seed: int, sizes: Sequence[float] = (0.2, 0.4, 0.8, 1.0, 2.0)) -> list[Plan]:
    """``count`` scenarios: of ten, two clean, five with one cause, one with two or three, two with an outside cause.

    Kinds, sizes and arms take turns, so that each has its share whatever the count.
    """
    rng = np.random.default_rng([seed, 0])
    catalogue = _turns(tuple(CATALOGUE), rng)
    outside, arms = _turns(tuple(OUTSIDE), rng), _turns(ARMS, rng)
    turns = {"size": 0}

    def next_size(choices: Sequence[float]) -> float:
        turns["size"] += 1
        return choices[turns["size"] % len(choices)]

    plans = []
    for number in range(count):
        plan = Plan(number, seed, next(arms), scatter=SCATTER[int(rng.integers(len(SCATTER)))])
        place = number % 10
        if place in (0, 5):
            pass
        elif place == 9:
            several = tuple(next(catalogue) for _ in range(int(rng.integers(2, 4))))
            plan = replace(plan, kinds=several, size=next_size((1.0, 2.0)))
        elif place in (4, 8):
            plan = replace(plan, kinds=(next(outside),), size=next_size((0.8, 1.5)))
        else:
            plan = replace(plan, kinds=(next(catalogue),), size=next_size(sizes))
        plans.append(plan)
    return plans


def _turns(names: tuple[str, ...], rng: Generator) -> Any:
    while True:
        yield from (names[k] for k in rng.permutation(len(names)))
