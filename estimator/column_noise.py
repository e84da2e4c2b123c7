"""How much noise of the measured motion stands in each column of the regressor (thesis, section 5.4).

The noise spectra of angles and velocities are carried into the columns by doing it: noise drawn from them is added to
the measured motion, and what that changes in the rows is column noise, with all that the filters, the arm's geometry
and the friction's sigmoids make of it, and with its correlation between columns and over time.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.channel_noise import ChannelNoise
from estimator.normal_equations import NormalEquations
from estimator.rows import Layout, trajectory_rows
from estimator.sums import LAGS, Sums, lagged_products
from estimator.trajectory import Trajectory, part_of

Array = NDArray[np.float64]

_ENOUGH = 20.0
"""s of recordings to draw on; shorter ones are drawn on several times."""
_MOST_DRAWS = 4
_LEAST_INFORMATION = 0.05
"""Share of a direction's information that a correction must leave (Fuller's modification): beyond it the noise drowns
the motion, and the corrected estimate would have no moments."""


def column_noise(
    layout: Layout, trajectories: Sequence[Trajectory], band: float, noise: ChannelNoise, seed: int = 0
) -> list[Array]:
    """For each joint (LAGS, p, p): mean products of a row's column noise at equal times and at lags (there D + Dᵀ).

    ``p`` unknowns of the joint, in the order of its columns. Commanded motion has none.
    """
    random = np.random.default_rng(seed)
    span = max(_ENOUGH / len(trajectories), 1.0)
    parts = [part_of(t, float(t.t[0]), float(t.t[0]) + span) for t in trajectories]
    duration = sum(float(t.t[-1] - t.t[0]) for t in parts)
    widths = [len(layout.unknowns(joint)) for joint in range(layout.body.n)]
    total, rows = [np.zeros((LAGS, p, p)) for p in widths], 0
    plain = replace(layout, instruments=False)
    for _ in range(int(np.clip(_ENOUGH / duration, 1, _MOST_DRAWS))):
        for part in parts:
            pairs = zip(
                trajectory_rows(plain, part, band, Sums()),
                trajectory_rows(plain, _disturbed(part, noise, random), band, Sums()),
                strict=True,
            )
            for (clean, _), (noisy, _) in pairs:
                rows += clean[0].shape[1]
                for joint, p in enumerate(widths):
                    change = noisy[joint][:p] - clean[joint][:p]
                    total[joint] += lagged_products(change, 0, change.shape[1])
    return [x / max(rows, 1) for x in total]


def motion_noise_autocovariance(layout: Layout, noise: Sequence[Array], unknowns: Array) -> Array:
    """(n, LAGS) of the torque that noise in the motion makes at these unknowns (P,): |T|²·S_n of Eq. 5.49, in time."""
    result = np.zeros((layout.body.n, LAGS))
    for joint, products in enumerate(noise):
        mine = unknowns[layout.unknowns(joint)]
        result[joint] = np.einsum("a,lab,b->l", mine, products, mine)
    result[:, 1:] /= 2.0
    return result


def without_column_noise(
    layout: Layout, sums: Sums, equations: NormalEquations, chosen: list[int], noise: Sequence[Array], weights: Array
) -> NormalEquations:
    """The normal equations of the chosen unknowns less the share that noise has in their matrix.

    This is total least squares with the noise covariance of every column known and the torque's noise left free: its
    stationary point solves (KᵀWK − E[δKᵀWδK])·unknowns = KᵀW·tau, and its Lagrange multiplier is then one.
    """
    everything = np.zeros((layout.size, layout.size))
    for joint, products in enumerate(noise):
        unknowns = layout.unknowns(joint)
        everything[np.ix_(unknowns, unknowns)] += np.einsum("l,lab->ab", weights[joint], products)
    share = everything[np.ix_(chosen, chosen)]
    rows = np.array([batch.rows for batch in sums.batches], dtype=float)
    total = equations.total
    scale = np.sqrt(np.diag(total))
    factor = np.linalg.inv(np.linalg.cholesky(total / np.outer(scale, scale)))
    drowned = factor @ (rows.sum() * share / np.outer(scale, scale)) @ factor.T
    largest = float(np.linalg.eigvalsh(drowned)[-1])
    share = share * min(1.0, (1.0 - _LEAST_INFORMATION) / max(largest, np.finfo(float).tiny))
    return replace(equations, matrix=equations.matrix - rows[:, None, None] * share)


def _disturbed(trajectory: Trajectory, noise: ChannelNoise, random: np.random.Generator) -> Trajectory:
    dq = trajectory.dq
    if dq is not None and noise.velocity is not None:
        dq = dq + _drawn(trajectory, noise.frequency, noise.velocity, random)
    return replace(trajectory, q=trajectory.q + _drawn(trajectory, noise.frequency, noise.angle, random), dq=dq)


def _drawn(trajectory: Trajectory, frequency: Array, density: Array, random: np.random.Generator) -> Array:
    """(samples, n) noise of a one-sided power density; beyond the known frequencies it goes on as at their end."""
    shape = trajectory.q.shape
    own = np.fft.rfftfreq(shape[0], 1.0 / trajectory.rate)
    amplitude = np.array([np.sqrt(np.interp(own, frequency, d) * trajectory.rate / 2.0) for d in density.T]).T
    return np.asarray(np.fft.irfft(np.fft.rfft(random.normal(size=shape), axis=0) * amplitude, shape[0], axis=0))
