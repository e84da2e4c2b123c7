"""What else the recordings could be: channels in another order, joints turned round, torques turned, degrees.

Each hypothesis is the same data read in another way, and is fitted as they are. Physics decides: links share their
parameters over the joints, so the right reading of the channels fits far better than any wrong one.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.plausibility.doubt import Kind
from estimator.plausibility.snapshot import ORDERS, Snapshot, fit
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

DEGREE = np.pi / 180.0
_BETTER = 0.98
"""An exchange of two joints must lower the misfit at least so far to be taken on the way to the best order."""


@dataclass(frozen=True)
class Reading:
    """One way to read the channels, and what it leaves unexplained. ``order``: for one of `ORDERS`, what is recorded
    at each of the body's joints."""

    kind: Kind
    joints: tuple[int, ...]
    misfit: float
    order: tuple[int, ...] = ()


def readings(body: RigidBody, base: BaseParameters, shot: Snapshot, as_it_is: float) -> list[Reading]:
    """Every other reading with its misfit, the best first; ``as_it_is`` is the misfit of the channels as they came."""
    result: list[Reading] = []
    for kind, joints, other in _simple(shot):
        trial = fit(body, base, other)
        if trial is not None:
            result.append(Reading(kind, joints, trial.misfit))
    for kind in ORDERS:
        order, misfit = _best_order(body, base, shot, kind, as_it_is)
        changed = tuple(j for j, k in enumerate(order) if j != k)
        if changed:
            result.append(Reading(kind, changed, misfit, tuple(order)))
    return sorted(result, key=lambda reading: reading.misfit)


def _simple(shot: Snapshot) -> Iterator[tuple[Kind, tuple[int, ...], Snapshot]]:
    n = shot.q.shape[1]
    yield (
        "angles in degrees",
        tuple(range(n)),
        replace(shot, q=shot.q * DEGREE, dq=shot.dq * DEGREE, ddq=shot.ddq * DEGREE),
    )
    for joint in range(n):
        sign = np.where(np.arange(n) == joint, -1.0, 1.0)
        yield "torque sign", (joint,), replace(shot, tau=shot.tau * sign)
        yield (
            "joint turned round",
            (joint,),
            replace(shot, q=shot.q * sign, dq=shot.dq * sign, ddq=shot.ddq * sign, tau=shot.tau * sign),
        )


def _best_order(
    body: RigidBody, base: BaseParameters, shot: Snapshot, kind: Kind, as_it_is: float
) -> tuple[list[int], float]:
    """Exchanges of two joints, the best first, for as long as one helps. All of them together make any order."""
    order, misfit = list(range(body.n)), as_it_is
    for _ in range(body.n - 1):
        trials: list[tuple[float, list[int]]] = []
        for a, b in combinations(range(body.n), 2):
            trial = order.copy()
            trial[a], trial[b] = trial[b], trial[a]
            found = fit(body, base, shot.of(kind, trial))
            if found is not None:
                trials.append((found.misfit, trial))
        best = min(trials, default=(np.inf, order))
        if not best[0] < _BETTER * misfit:
            break
        misfit, order = best
    return order, misfit
