"""On which joints friction at rest is no function of velocity: judged by what a fit of the motion says of the rests.

Some drives come to rest with the friction that they moved with, and their rests fit like their motion; in others
control keeps pulling at a joint that static friction holds, and the rests contradict the motion.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.normal_equations import assemble, excited, residual_autocovariance, torque_power
from estimator.rigid_body import RigidBody
from estimator.rows import Layout, friction_widths, make_layout, sum_up, trajectory_rows
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
    unknowns = _fit_of_motion(replace(everything, rest_speed=limits), part, band)
    if unknowns is None:
        return limits
    at_rest, in_motion = _mean_squares(everything, limits, part, band, unknowns)
    return np.where(at_rest > _CONTRADICTS * in_motion, limits, 0.0)


def _fit_of_motion(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> Array | None:
    """Unknowns (P,) by least squares, weighted once by residuals; None when the rows are too few."""
    sums = sum_up(layout, trajectories, band)
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
    return unknowns


def _mean_squares(
    layout: Layout, limits: Array, trajectories: Sequence[Trajectory], band: float, unknowns: Array
) -> tuple[Array, Array]:
    """(n,) each: of the residual where the joint rests, and where it moves."""
    moving = replace(layout, rest_speed=limits)
    totals, counts = np.zeros((2, layout.body.n)), np.zeros((2, layout.body.n))
    for trajectory in trajectories:
        pieces = zip(
            trajectory_rows(layout, trajectory, band, Sums()),
            trajectory_rows(moving, trajectory, band, Sums()),
            strict=True,
        )
        for (rows, _), (_, counted) in pieces:
            for joint in range(layout.body.n):
                mine = layout.unknowns(joint)
                residual = rows[joint][len(mine)] - unknowns[mine] @ rows[joint][: len(mine)]
                for k, here in enumerate((counted[joint] < 0.01, counted[joint] > 0.99)):
                    totals[k, joint] += residual[here] @ residual[here]
                    counts[k, joint] += np.count_nonzero(here)
    mean = totals / np.maximum(counts, 1.0)
    return np.where(counts[0] >= _LEAST_ROWS, mean[0], 0.0), mean[1]
