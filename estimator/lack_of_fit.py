"""Does the model leave more than noise? The test of a fit against the pure error of repeated motion.

Of the residual over the playings of one motion the mean is what the model lacks (and a part of the noise), the scatter
about the mean is noise alone. Without lack of fit their mean squares, each over its degrees of freedom, have a ratio
of one with Fisher's distribution. Where it is larger, standard errors say how far the answer would scatter, not how far
it is from the truth. Errors of a coarse encoder's steps may be the same in all playings: they count as noise
(`estimator.encoder_steps`).
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from estimator.column_noise import motion_noise_autocovariance
from estimator.encoder_steps import step_errors_alike
from estimator.identification import LackOfFit
from estimator.repeats import RepeatGroup, find_repeats
from estimator.rows import Layout, trajectory_rows
from estimator.sums import LAGS, Sums
from estimator.trajectory import Trajectory, part_of

Array = NDArray[np.float64]

_ENOUGH, _LEAST = 60.0, 6.0
"""s of all recordings, and of each at least, in which repeats are looked for."""
_LEAST_ROWS = 8


@dataclass(frozen=True)
class Playings:
    """Rows of every repeated motion, each as an array of one playing after the other."""

    layout: Layout
    rows: tuple[tuple[list[list[Array]], Array], ...]
    """A motion: for each playing its rows (n arrays), and how many rows of each joint count (n,)."""
    steps: list[Array] | None = None
    """Of the columns' noise the part that playings have in common (`estimator.encoder_steps`); None for none."""

    def alike(self, unknowns: Array) -> Array:
        """(n,) N²·m²: mean square of what encoder steps put alike into the residuals of every playing."""
        if self.steps is None:
            return np.zeros(self.layout.body.n)
        return motion_noise_autocovariance(self.layout, self.steps, unknowns)[:, 0]

    def residuals(self, unknowns: Array) -> list[tuple[Array, Array]]:
        """A motion: residuals (playings, rows, n) N·m at these unknowns (P,), and the count of each joint's rows."""
        joints = range(self.layout.body.n)
        return [
            (
                np.array([[_residual(self.layout, unknowns, j, x[j]) for j in joints] for x in each]).swapaxes(1, 2),
                count,
            )
            for each, count in self.rows
        ]

    def pure_error(self, unknowns: Array) -> Array | None:
        """(n, LAGS) autocovariance of the rows' noise; None without repeats."""
        total, between = np.zeros((self.layout.body.n, LAGS)), np.zeros(self.layout.body.n)
        for stack, counted in self.residuals(unknowns):
            deviation = stack - stack.mean(axis=0)
            for lag in range(LAGS):
                total[:, lag] += np.sum(deviation[:, lag:] * deviation[:, : stack.shape[1] - lag], axis=(0, 1))
            between += (len(stack) - 1.0) * counted
        return total / between[:, None] if np.all(between > _LEAST_ROWS) else None


def find_playings(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> Playings:
    """The rows of all motion that recurs; the search looks at a few minutes of all recordings."""
    span = max(_ENOUGH / len(trajectories), _LEAST)
    searched = [part_of(t, float(t.t[0]), float(t.t[0]) + span) for t in trajectories]
    plain = replace(layout, instruments=False)
    groups = find_repeats(searched)
    found = [_rows(plain, searched, group, band) for group in groups]
    kept = tuple(x for x in found if len(x[0]) > 1 and x[0][0][0].shape[1] >= _LEAST_ROWS)
    if not kept:
        return Playings(layout, kept)
    apart = np.sqrt(np.mean([group.mismatch**2 for group in groups], axis=0))
    return Playings(layout, kept, step_errors_alike(plain, trajectories, band, apart))


def lack_of_fit(playings: Playings, unknowns: Array, fitted: int, rows: int) -> tuple[LackOfFit, ...] | None:
    """One test a joint; None where no motion recurs. ``unknowns`` (P,) as fitted, ``fitted`` of them free, to ``rows``.

    The residuals are the estimate's own: same rows, same band, rests left out where they were.
    """
    n = playings.layout.body.n
    mean, scatter, fourth = np.zeros(n), np.zeros(n), np.zeros(n)
    lagged = np.zeros((LAGS - 1, n))
    free, between, judged = np.zeros(n), np.zeros(n), np.zeros(n)
    total = 0
    for stack, counted in playings.residuals(unknowns):
        count = len(stack)
        total += count
        deviation = stack - stack.mean(axis=0)
        mean += count * np.sum(stack.mean(axis=0) ** 2, axis=0)
        scatter += np.sum(deviation**2, axis=(0, 1))
        fourth += np.sum(deviation**4, axis=(0, 1)) * (count / (count - 1.0)) ** 2
        for lag in range(1, LAGS):
            lagged[lag - 1] += np.sum(deviation[:, lag:] * deviation[:, :-lag], axis=(0, 1))
        free += counted
        between += (count - 1.0) * counted
        judged += count * counted
    if not np.all(between > _LEAST_ROWS):
        return None
    # The fit has taken its unknowns out of the means. Rows of coloured noise, or of noise that comes and goes with the
    # motion, count for less than one: a mean square scatters by its spectrum squared, and by its fourth moment.
    share = np.array([len(playings.layout.unknowns(j)) for j in range(n)], dtype=float)
    absorbed = fitted * share / share.sum() * np.minimum(1.0, judged / rows)
    left = np.maximum(free - absorbed, 1.0)
    tiny = np.finfo(float).tiny
    colour = 1.0 + 2.0 * np.sum((lagged / np.maximum(scatter, tiny)) ** 2, axis=0)
    bursts = np.maximum(fourth * judged / (3.0 * np.maximum(scatter * judged / between, tiny) ** 2), 1.0)
    fewer = 1.0 / (colour * bursts)
    noise = np.maximum(scatter / between, tiny)
    alike = playings.alike(unknowns)
    ratio = mean / left / (noise + alike * judged / free)
    p_values = np.asarray(fisher.sf(ratio, np.maximum(left * fewer, 1.0), np.maximum(between * fewer, 1.0)))
    lacking = np.sqrt(np.maximum(mean - free * noise - judged * alike, 0.0) / judged)
    return tuple(
        LackOfFit(float(ratio[j]), float(p_values[j]), float(lacking[j]), float(np.sqrt(noise[j])), total)
        for j in range(n)
    )


def _rows(
    layout: Layout, trajectories: Sequence[Trajectory], group: RepeatGroup, band: float
) -> tuple[list[list[Array]], Array]:
    """Rows of the playings that are whole, cut to the shortest, and how many of each joint's count (n,)."""
    found: list[list[Array]] = []
    counted: list[Array] = []
    for occurrence in group.occurrences:
        playing = part_of(trajectories[occurrence.trajectory], occurrence.start, occurrence.start + group.duration)
        pieces = list(trajectory_rows(layout, playing, band, Sums()))
        if len(pieces) == 1:
            found.append(pieces[0][0])
            counted.append(pieces[0][1].sum(axis=1))
    shortest = min((rows[0].shape[1] for rows in found), default=0)
    least = np.min(counted, axis=0) if counted else np.zeros(layout.body.n)
    return [[x[:, :shortest] for x in rows] for rows in found], least


def _residual(layout: Layout, unknowns: Array, joint: int, rows: Array) -> Array:
    mine = layout.unknowns(joint)
    return np.asarray(rows[len(mine)] - unknowns[mine] @ rows[: len(mine)])
