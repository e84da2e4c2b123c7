"""Does the model leave more than noise? The test of a fit against the pure error of repeated motion.

Of the residual over the playings of one motion the mean is what the model lacks (and a part of the noise), the scatter
about the mean is noise alone. Without lack of fit their mean squares, each over its degrees of freedom, have a ratio
of one with Fisher's distribution. Where it is larger, standard errors say how far the answer would scatter, not how far
it is from the truth.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from estimator.identification import LackOfFit
from estimator.repeats import RepeatGroup, find_repeats
from estimator.rows import Layout, trajectory_rows
from estimator.sums import Sums
from estimator.trajectory import Trajectory, part_of

Array = NDArray[np.float64]

_ENOUGH, _LEAST = 240.0, 24.0
"""s of all recordings, and of each at least, in which repeats are looked for."""
_LEAST_ROWS = 8


def lack_of_fit(
    layout: Layout, unknowns: Array, fitted: int, rows: int, trajectories: Sequence[Trajectory], band: float
) -> tuple[LackOfFit, ...] | None:
    """One test a joint; None where no motion recurs. ``unknowns`` (P,) as fitted, ``fitted`` of them free, to ``rows``.

    The residuals are the estimate's own: same rows, same band, rests left out where they were.
    """
    span = max(_ENOUGH / len(trajectories), _LEAST)
    searched = [part_of(t, float(t.t[0]), float(t.t[0]) + span) for t in trajectories]
    n = layout.body.n
    mean, scatter, neighbours = np.zeros(n), np.zeros(n), np.zeros(n)
    free, between, judged = np.zeros(n), np.zeros(n), np.zeros(n)
    playings = 0
    for group in find_repeats(searched):
        stack, counted = _residuals(layout, unknowns, searched, group, band)
        count = len(stack)
        if count < 2 or stack.shape[1] < _LEAST_ROWS:
            continue
        playings += count
        deviation = stack - stack.mean(axis=0)
        mean += count * np.sum(stack.mean(axis=0) ** 2, axis=0)
        scatter += np.sum(deviation**2, axis=(0, 1))
        neighbours += np.sum(deviation[:, 1:] * deviation[:, :-1], axis=(0, 1))
        free += counted
        between += (count - 1.0) * counted
        judged += count * counted
    if playings == 0 or not np.all(between > _LEAST_ROWS):
        return None
    # The fit has taken its unknowns out of the means, and neighbouring rows of coloured noise count for less than one.
    share = np.array([len(layout.unknowns(j)) for j in range(n)], dtype=float)
    absorbed = fitted * share / share.sum() * np.minimum(1.0, judged / rows)
    left = np.maximum(free - absorbed, 1.0)
    correlation = np.clip(neighbours / np.maximum(scatter, np.finfo(float).tiny), 0.0, 0.95)
    fewer = (1.0 - correlation**2) / (1.0 + correlation**2)
    noise = np.maximum(scatter / between, np.finfo(float).tiny)
    ratio = mean / left / noise
    p_values = np.asarray(fisher.sf(ratio, np.maximum(left * fewer, 1.0), np.maximum(between * fewer, 1.0)))
    lacking = np.sqrt(np.maximum(mean - free * noise, 0.0) / judged)
    return tuple(
        LackOfFit(float(ratio[j]), float(p_values[j]), float(lacking[j]), float(np.sqrt(noise[j])), playings)
        for j in range(n)
    )


def _residuals(
    layout: Layout, unknowns: Array, trajectories: Sequence[Trajectory], group: RepeatGroup, band: float
) -> tuple[Array, Array]:
    """(playings, rows, n) N·m residuals of the playings that are whole, and how many rows of each joint count (n,)."""
    found: list[Array] = []
    counted: list[Array] = []
    for occurrence in group.occurrences:
        playing = part_of(trajectories[occurrence.trajectory], occurrence.start, occurrence.start + group.duration)
        pieces = list(trajectory_rows(layout, playing, band, Sums()))
        if len(pieces) == 1:
            rows, counts = pieces[0]
            residual = [_residual(layout, unknowns, joint, rows[joint]) for joint in range(layout.body.n)]
            found.append(np.array(residual).T)
            counted.append(counts.sum(axis=1))
    shortest = min((len(x) for x in found), default=0)
    if not shortest:
        return np.empty((0, 0, layout.body.n)), np.zeros(layout.body.n)
    return np.array([x[:shortest] for x in found]), np.min(counted, axis=0)


def _residual(layout: Layout, unknowns: Array, joint: int, rows: Array) -> Array:
    mine = layout.unknowns(joint)
    return np.asarray(rows[len(mine)] - unknowns[mine] @ rows[: len(mine)])
