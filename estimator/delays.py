"""How late the channels of a recording are against each other.

A velocity that is late against the angle shows as a part of its error that looks like the angle's acceleration. A
torque that is late against the motion hides in the fit (much of it passes for viscous friction and inertia), so it is
found by profile: the whole identification is repeated with shifted torques, and the shift that leaves least wins.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize_scalar

from estimator.base_parameters import base_parameters
from estimator.convolution import convolve
from estimator.filtering import plan_filter, resample
from estimator.held_by_friction import speeds_to_leave_out
from estimator.normal_equations import assemble, excited, residual_autocovariance
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK, Layout, friction_widths, make_layout, sum_up
from estimator.terms import TERM_NAMES, candidate_terms
from estimator.trajectory import Trajectory
from estimator.whitening import white_weight

Array = NDArray[np.float64]

_LONGEST = 0.03
"""s; no measuring channel of an arm is later than that."""


@dataclass(frozen=True)
class Delay:
    """Positive: the channel is late against the angles. s."""

    value: float
    standard_error: float


def velocity_delay(trajectories: Sequence[Trajectory], band: float) -> Delay | None:
    """Of measured velocities against differentiated angles, all joints alike; None where no velocity was measured.

    v = g·dq(t − δ) ≈ g·dq − g·δ·ddq by least squares in ``band`` (Hz); the scatter over joints and pieces gives the
    error.
    """
    estimates: list[float] = []
    weights: list[float] = []
    for trajectory in trajectories:
        if trajectory.dq is None:
            return None
        plan = plan_filter(trajectory.rate, band)
        for piece in trajectory.segments(CHUNK // 4, 0):
            if len(piece) < 8 * plan.edge:
                continue
            q = resample(trajectory.t[piece], trajectory.q[piece], plan.rate)
            dq = resample(trajectory.t[piece], trajectory.dq[piece], plan.rate)
            measured, slope, curvature = (
                convolve(x, kernel) for x, kernel in ((dq, plan.smooth), (q, plan.slope), (q, plan.curvature))
            )
            for joint in range(q.shape[1]):
                columns = np.column_stack([slope[:, joint], -curvature[:, joint]])
                energy = float(curvature[:, joint] @ curvature[:, joint])
                if energy <= 0.0:
                    continue
                gain, product = np.linalg.lstsq(columns, measured[:, joint], rcond=None)[0]
                estimates.append(float(product / gain) if gain else 0.0)
                weights.append(energy)
    if not estimates:
        return None
    mean = float(np.average(estimates, weights=weights))
    share = np.array(weights) / np.sum(weights)
    scatter = float(np.sqrt(np.sum(share**2 * (np.array(estimates) - mean) ** 2)))
    return Delay(mean, scatter)


def torque_delay(body: RigidBody, trajectories: Sequence[Trajectory], band: float) -> Delay:
    """Of measured torques against the motion, all joints alike, with base parameters, friction and offsets refitted.

    ``band`` Hz as in the identification. Velocities that are late themselves are set right first, with `delayed`: the
    motion is taken from angles and velocities together. The error is from the curvature of the profile and holds for
    a good model.
    """
    base, terms = base_parameters(body), candidate_terms(TERM_NAMES, friction_widths(trajectories))
    layout = make_layout(body, base, terms, rest_speed=speeds_to_leave_out(body, base, trajectories, band))
    first = residual_power(layout, trajectories, band)
    weight = 1.0 / np.maximum(first[0], np.finfo(float).tiny)

    def misfit(delay: float) -> float:
        power, rows = residual_power(layout, [delayed(t, torque=-delay) for t in trajectories], band)
        return rows * float(weight @ power)

    found = minimize_scalar(misfit, bounds=(-_LONGEST, _LONGEST), method="bounded", options={"xatol": 2e-5})
    best, step = float(found.x), 1e-3
    curvature = (misfit(best + step) - 2.0 * misfit(best) + misfit(best - step)) / step**2
    return Delay(
        best, float(np.sqrt(2.0 * misfit(best) / (first[1] * body.n) / curvature)) if curvature > 0 else np.inf
    )


def delayed(trajectory: Trajectory, torque: float = 0.0, velocity: float = 0.0) -> Trajectory:
    """The same recording with torques and velocities that many seconds later (negative: a delay taken back)."""

    def late(channel: Array, by: float) -> Array:
        if by == 0.0:
            return channel
        columns = [
            np.interp(trajectory.t - by, trajectory.t, column, left=np.nan, right=np.nan) for column in channel.T
        ]
        return np.array(columns).T

    dq = None if trajectory.dq is None else late(trajectory.dq, velocity)
    return replace(trajectory, tau=late(trajectory.tau, torque), dq=dq)


def residual_power(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> tuple[Array, int]:
    """Mean square residual of each joint (n,), N²·m², after a plain least-squares fit, and the rows behind it."""
    sums = sum_up(layout, trajectories, band)
    equations = assemble(layout, sums, np.array([white_weight(1.0)] * layout.body.n))
    chosen = excited(equations, layout.base.rank, 1e-6)
    unknowns = np.zeros(layout.size)
    part = equations.of(chosen)
    unknowns[chosen] = np.linalg.solve(part.matrix.sum(axis=0), part.right.sum(axis=0))
    return residual_autocovariance(layout, sums.batches, unknowns)[:, 0], sums.rows
