"""On which joints friction at rest is no function of velocity: judged by what a fit of the motion says of the rests.

Some drives come to rest with the friction that they moved with, and their rests fit like their motion; in others
control keeps pulling at a joint that static friction holds, and the rests contradict the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.normal_equations import assemble, excited, residual_autocovariance, torque_power
from estimator.rigid_body import RigidBody
from estimator.rows import Layout, friction_widths, make_layout, trajectory_rows
from estimator.standstill import rest_speeds
from estimator.sums import Sums
from estimator.terms import TERM_NAMES, candidate_terms
from estimator.trajectory import Trajectory, part_of
from estimator.whitening import white_weight

Array = NDArray[np.float64]

_CONTRADICTS = 16.0
"""Mean square residual at rest over that in motion."""
_ENOUGH = 60.0
"""s of recordings to judge by, spread over all of them."""
_LEAST_ROWS = 8
"""At rest, to say anything."""
_AT_REST = 0.01
"""Share of a row that is motion at most where it says what a rest says."""


def speeds_to_leave_out(
    body: RigidBody,
    base: BaseParameters,
    trajectories: Sequence[Trajectory],
    band: float,
    crossover: Array | None = None,
) -> Array:
    """(n,) rad/s (m/s): slower is left out; zero for joints whose rests agree with their motion. ``band`` Hz and
    ``crossover`` as in the identification."""
    limits = rest_speeds(trajectories)
    if not limits.any():
        return limits
    # The narrowest sigmoid is all but the sign: at rest it says as much as any function of velocity can.
    terms = candidate_terms(TERM_NAMES, friction_widths(trajectories)[:, :1])
    everything = make_layout(body, base, terms, crossover=crossover)
    span = _ENOUGH / len(trajectories)
    part = [part_of(trajectory, float(trajectory.t[0]), float(trajectory.t[0]) + span) for trajectory in trajectories]
    fitted = _fit_of_motion(replace(everything, rest_speed=limits), part, band)
    if fitted is None:
        return limits
    at_rest = _mean_square_at_rest(everything, part, band, fitted)
    return np.where(at_rest > _CONTRADICTS * fitted.mean_square, limits, 0.0)


@dataclass(frozen=True)
class _MotionFit:
    """A fit of what moves."""

    unknowns: Array
    """(P,)"""
    mean_square: Array
    """(n,) of the residual in motion."""
    counted: list[Array]
    """Of each segment (n, rows): how much of a joint's row is motion."""


def _fit_of_motion(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> _MotionFit | None:
    """By least squares, weighted once by residuals; None when the rows are too few."""
    sums, segments = Sums(), []
    for recording, trajectory in enumerate(trajectories):
        for rows, counted in trajectory_rows(layout, trajectory, band, sums):
            sums.add(rows, recording, counted)
            segments.append(counted)
    if sums.rows * layout.body.n < 2 * layout.size or sums.counted.min() < _LEAST_ROWS:
        return None
    unknowns = np.zeros(layout.size)
    variance = torque_power(layout, sums.batches)
    for _ in range(2):
        equations = assemble(layout, sums, np.array([white_weight(v) for v in np.maximum(variance, 1e-300)]))
        chosen = excited(equations, layout.base.rank, 1e-6)
        some = equations.of(chosen)
        unknowns[chosen] = np.linalg.solve(some.total, some.total_right)
        floor = 1e-14 * torque_power(layout, sums.batches)
        variance = np.maximum(residual_autocovariance(layout, sums.batches, unknowns)[:, 0], floor)
    return _MotionFit(unknowns, variance, segments)


def _mean_square_at_rest(layout: Layout, trajectories: Sequence[Trajectory], band: float, fitted: _MotionFit) -> Array:
    """(n,) of the residual where a joint rests; zero where it does so too seldom to say anything."""
    total, count = np.zeros(layout.body.n), np.zeros(layout.body.n)
    segments = (rows for t in trajectories for rows, _ in trajectory_rows(layout, t, band, Sums()))
    for rows, counted in zip(segments, fitted.counted, strict=True):
        for joint in range(layout.body.n):
            mine = layout.unknowns(joint)
            here = counted[joint] < _AT_REST
            residual = rows[joint][len(mine), here] - fitted.unknowns[mine] @ rows[joint][: len(mine), here]
            total[joint] += residual @ residual
            count[joint] += np.count_nonzero(here)
    return np.where(count >= _LEAST_ROWS, total / np.maximum(count, 1.0), 0.0)
