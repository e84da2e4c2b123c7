"""Shapes of laws between the points of their grids, by halves: what steps along a slope do not reach.

A contact that begins half a second late, or an order a third of a period off, has no slope that points to the right
one.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional, groups_of
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]

_HALVES = 5
"""Times that a step is halved, beginning with half of the grid's."""
_IDLE = 2
"""Halves that may bring nothing before the rest is left."""
_BETTER = 0.5
"""nats; less is left to the steps along the slope."""


def scanned(
    design: Design,
    chosen: Sequence[int],
    weights: Array,
    pass_over: Callable[[Sequence[Candidate]], tuple[Design, Block]],
) -> list[Candidate]:
    """The chosen candidates with the best of the theta that are tried; those that only shape a sign, or are a choice,
    stay, and all of dry frictions, which slopes lead to. ``pass_over`` makes the products of any columns."""
    candidates = [design.candidates[k] for k in chosen]
    steps = [_steps(design, k) for k in chosen]
    if not any(np.any(step) for step in steps):
        return candidates
    idle = 0
    for half in range(1, _HALVES + 1):
        tried = [(n, moved) for n, step in enumerate(steps) for moved in _moved(candidates[n], 0.5**half * step)]
        wide, block = pass_over([*candidates, *(moved for _, moved in tried)])
        told, places = Weighted(wide, block, weights), list(range(len(candidates)))
        for number in range(len(candidates)):
            own = [number, *(len(candidates) + k for k, (n, _) in enumerate(tried) if n == number)]
            others = [wide.candidates[place].columns for n, place in enumerate(places) if n != number]
            active = np.concatenate([np.arange(wide.given), *others]).astype(np.intp)
            gains = Conditional(told, active).gains(groups_of(wide, own))
            best = max(own, key=lambda k: gains[k])
            if gains[best] > gains[number] + _BETTER:
                places[number] = best
        idle = 0 if places != list(range(len(candidates))) else idle + 1
        candidates = [wide.candidates[place] for place in places]
        if idle == _IDLE:
            break
    return candidates


def _steps(design: Design, candidate: int) -> Array:
    """(2, p) from a candidate's theta down and up to the next ones of its grid, entry by entry; zero for what stays."""
    own = design.candidates[candidate]
    effect, place = design.hypotheses[own.hypothesis].effect, design.hypotheses[own.hypothesis].place
    if effect.dry or effect.timed(place) is not None:
        return np.zeros((2, len(own.theta)))
    stays = {*effect.hidden, *effect.choices, *effect.about}
    grid = np.array([c.theta for c in design.candidates if c.hypothesis == own.hypothesis])
    same = grid[np.all(grid[:, list(effect.choices)] == own.theta[list(effect.choices)], axis=1)]
    result = np.zeros((2, len(own.theta)))
    for k in set(range(len(own.theta))) - stays:
        apart = same[:, k] - own.theta[k]
        result[0, k] = np.max(apart[apart < 0.0], initial=-np.inf)
        result[1, k] = np.min(apart[apart > 0.0], initial=np.inf)
    return np.where(np.isfinite(result), result, 0.0)


def _moved(candidate: Candidate, step: Array) -> list[Candidate]:
    """With each entry of theta a ``step`` (2, p) down and up."""
    result = []
    for way, k in zip(*np.nonzero(step), strict=True):
        theta = candidate.theta.copy()
        theta[k] += step[way, k]
        result.append(replace(candidate, theta=theta))
    return result
