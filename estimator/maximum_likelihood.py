"""Maximum likelihood with the true motion among the unknowns: output error, with noise in every channel.

Angles, velocities and torques are all measured with noise of one true motion x and one set of unknowns:

    q = x + n_q,  dq = ẋ + n_v,  tau = K(x, ẋ, ẍ)·unknowns + n_tau

Minimised over both is the sum of squares of all three noises over their variances. The motion is a spline, stretch by
stretch; eliminated from each stretch's Gauss–Newton equations (Schur complement) it leaves equations in the unknowns
alone, which add up over stretches. Nothing is differentiated and no noise is taken out of columns: the motion that
torques and sensors agree on has none to be counted. It is what the Cramér–Rao bound presumes.

Variances of angle and velocity are those of redundant sensing (`estimator.channel_noise`), averaged over the band; of
the torque's rows, the likeliest once the motion is eliminated (restricted likelihood, Fisher scoring).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.linalg import cho_solve_banded, cholesky_banded

from config import InputError
from estimator.channel_noise import ChannelNoise
from estimator.estimation import Estimate
from estimator.motion_spline import MotionSpline, Sparse, motion_spline
from estimator.normal_equations import solve
from estimator.regressor import inverse_dynamics_slopes
from estimator.rows import Layout, RowMaker, on_grid, row_filter
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_STRETCH = 20.0
"""s; at the seams of a long recording the motion is free to jump."""
_LEAST_PASSES, _MOST_PASSES = 3, 8
_CLOSE = 0.05
"""Standard errors that the last pass may move an unknown by."""
_BATCHES, _LEAST_ROWS = 40, 8
"""In all, as far as the stretches allow; and the rows of each."""
_BATCHES_A_STRETCH = 10
_DRAWS = 8
"""Random signs a joint by which traces are told (Hutchinson)."""
_LARGEST_STEP = 30.0
"""Of a variance in one pass, as a factor."""
_LEAST_NOISE = 1e-12
"""rad/√Hz, rad/s/√Hz: no sensor is better; motion without noise stays solvable."""


@dataclass(frozen=True)
class _Variances:
    """Of one sample of angle and velocity at the sampling rate (n,), and of one row of torque (n,)."""

    angle: Array
    velocity: Array | None
    torque: Array


@dataclass(frozen=True)
class _Stretch:
    """A gapless stretch of a recording."""

    recording: int
    channels: dict[str, Array]
    maker: RowMaker
    spline: MotionSpline

    def usable(self) -> NDArray[np.bool_] | None:
        found = self.channels.get("unusable")
        return None if found is None else found.T <= 0.0

    def off_motion(self, motion: Array, which: str) -> Array:
        """(samples, n) of measured angle or velocity over the spline's."""
        order = ("q", "dq").index(which)
        return np.asarray(self.channels[which] - self.spline.at[order] @ motion)


@dataclass(frozen=True)
class _Linear:
    """Torque rows of a stretch about a motion and unknowns, each joint's."""

    residual: list[Array]
    """(rows,)"""
    columns: list[Array]
    """(rows, P)"""
    slopes: list[Sparse]
    """(rows, K·n)"""
    weight: Array
    """(n, rows) how much each row counts."""


@dataclass(frozen=True)
class _Reduced:
    """Equations of one stretch with the motion eliminated, how the motion moves, and what the torques leave."""

    matrix: Array
    """(batches, P, P)"""
    right: Array
    """(batches, P) for the step of the unknowns."""
    step: Array
    """(K, n) of the motion at unchanged unknowns."""
    score: Array
    """(n,) of the variances of the torques' rows: twice the slope of the likelihood."""
    information: Array
    """(n, n) of these variances, twice Fisher's."""


def maximum_likelihood(
    layout: Layout, trajectories: Sequence[Trajectory], band: float, noise: ChannelNoise, start: Estimate, power: Array
) -> Estimate:
    """The estimate refined from ``start``; ``power`` (n,) N²·m² is a first guess of the variance of a torque's row.

    Sharp bends of Coulomb friction correct no motion: within the noise of a velocity they are no straight lines.
    Raises InputError when no stretch is long enough.
    """
    layout = replace(layout, instruments=False)
    unknowns, chosen = np.zeros(layout.size), start.chosen
    unknowns[chosen] = start.solution.value
    motions: list[Array] = []
    torque = power
    seconds = sum(float(t.t[-1] - t.t[0]) for t in trajectories)
    pieces = int(np.clip(_BATCHES * _STRETCH / seconds, 1, _BATCHES_A_STRETCH))
    result = start
    for done in range(_MOST_PASSES):
        reduced: list[_Reduced] = []
        owners: list[int] = []
        for k, stretch in enumerate(_stretches(layout, trajectories, band)):
            variances = _variances(noise, band, stretch.maker.plan.rate, torque)
            if k == len(motions):
                q, dq = stretch.channels["q"], stretch.channels.get("dq")
                motions.append(stretch.spline.fitted(q, dq, variances.angle, variances.velocity))
            found = _reduced(layout, stretch, motions[k], unknowns, chosen, variances, pieces)
            motions[k] = motions[k] + found.step
            reduced.append(found)
            owners += [stretch.recording] * len(found.right)
        if not reduced:
            raise InputError("recordings", "have no gapless stretch to follow the motion in", "record longer motion")
        matrix = np.concatenate([x.matrix for x in reduced])
        right = np.concatenate([x.right for x in reduced]) + matrix @ unknowns[chosen]
        equations = replace(start.equations, matrix=matrix, right=right)
        result = replace(start, solution=solve(equations), equations=equations, owners=tuple(owners))
        moved = np.abs(result.solution.value - unknowns[chosen])
        unknowns[chosen] = result.solution.value
        if done + 1 >= _LEAST_PASSES and np.all(moved <= _CLOSE * np.sqrt(1.0 / np.diag(equations.total))):
            break
        # Fisher scoring, which from any start goes to the right variance on average.
        score, information = sum(x.score for x in reduced), sum(x.information for x in reduced)
        step = np.linalg.solve(np.asarray(information), np.asarray(score))
        torque = np.clip(torque + step, torque / _LARGEST_STEP, torque * _LARGEST_STEP)
    return result


def _stretches(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> Iterator[_Stretch]:
    for recording, trajectory in enumerate(trajectories):
        plan = row_filter(trajectory.rate, band)
        row = plan.stride * plan.decimation
        for piece in trajectory.segments(max(int(_STRETCH * trajectory.rate), _LEAST_ROWS * row), 0):
            if len(piece) >= _LEAST_ROWS * row:
                channels = on_grid(trajectory, piece, plan.rate, commanded=False)
                spline = motion_spline(len(channels["q"]), plan)
                yield _Stretch(recording, channels, RowMaker(layout, plan), spline)


def _variances(noise: ChannelNoise, band: float, rate: float, torque: Array) -> _Variances:
    """As white as noise in the band is dense: what lies above decides nothing."""
    inside = noise.frequency <= max(band, float(noise.frequency[1]))

    def sample(density: Array) -> Array:
        return np.asarray(np.maximum(density[inside].mean(axis=0), _LEAST_NOISE**2) * rate / 2.0)

    return _Variances(sample(noise.angle), None if noise.velocity is None else sample(noise.velocity), torque)


def _linear(layout: Layout, stretch: _Stretch, motion: Array, unknowns: Array, chosen: list[int]) -> _Linear:
    spline, maker = stretch.spline, stretch.maker
    now = spline.motion(motion)
    rows, counted = maker(now, stretch.channels["tau"], None, stretch.usable())
    weight = maker.weight(now.dq, stretch.usable())[:, :: maker.plan.stride]
    slopes = _torque_slopes(layout, unknowns, now.thinned.q, now.thinned.dq, now.thinned.ddq)
    place = {k: p for p, k in enumerate(chosen)}
    residual, columns = [], []
    for joint, own in enumerate(rows):
        mine = layout.unknowns(joint)
        residual.append(own[len(mine)] - unknowns[mine] @ own[: len(mine)])
        column = np.zeros((own.shape[1], len(chosen)))
        for row, k in zip(own, mine, strict=False):
            if k in place:
                column[:, place[k]] = row
        columns.append(column)
    by_motion = [spline.torque_slope(slopes[:, :, joint], weight[joint]) for joint in range(layout.body.n)]
    return _Linear(residual, columns, by_motion, counted)


def _torque_slopes(layout: Layout, unknowns: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """(3, samples, n, n) of rigid body and the terms that are linear in the motion."""
    combination = layout.base.combination
    full = np.linalg.pinv(combination) @ unknowns[: layout.base.rank]
    slopes = inverse_dynamics_slopes(layout.body, full, q, dq, ddq)
    place = layout.base.rank
    for terms in layout.terms:
        for term in terms:
            if term.name == "viscous_friction":
                slopes[1, :, term.joint, term.joint] += unknowns[place]
            elif term.name == "rotor_inertia":
                slopes[2, :, term.joint, term.joint] += unknowns[place]
            place += 1
    return slopes


class _MotionEquations:
    """Gauss–Newton equations of a stretch's motion, all joints together, factored."""

    def __init__(self, stretch: _Stretch, linear: _Linear, variances: _Variances) -> None:
        spline = stretch.spline
        matrix = sparse.kron(spline.grams[0], np.diag(1.0 / variances.angle), format="csr")
        if variances.velocity is not None:
            matrix = matrix + sparse.kron(spline.grams[1], np.diag(1.0 / variances.velocity), format="csr")
        for slope, variance in zip(linear.slopes, variances.torque, strict=True):
            matrix = matrix + slope.T @ slope / variance
        lower = sparse.tril(matrix).tocoo()
        band = np.zeros((int((lower.row - lower.col).max()) + 1, matrix.shape[0]))
        band[lower.row - lower.col, lower.col] = lower.data
        self._factor = cholesky_banded(band, lower=True, check_finite=False)

    def solve(self, right: Array) -> Array:
        return np.asarray(cho_solve_banded((self._factor, True), right, check_finite=False))


def _sensed_pull(stretch: _Stretch, motion: Array, variances: _Variances, samples: slice = slice(None)) -> Array:
    """(K·n,) gradient of what angle and velocity say of the motion, of some samples."""
    at = stretch.spline.at
    pull = at[0][samples].T @ (stretch.off_motion(motion, "q")[samples] / variances.angle)
    if variances.velocity is not None:
        pull = pull + at[1][samples].T @ (stretch.off_motion(motion, "dq")[samples] / variances.velocity)
    return np.asarray(pull).reshape(-1)


def _reduced(
    layout: Layout,
    stretch: _Stretch,
    motion: Array,
    unknowns: Array,
    chosen: list[int],
    variances: _Variances,
    pieces: int,
) -> _Reduced:
    """Equations of the step of the unknowns, batch by batch in time.

    With X what the motion follows of the unknowns, columns less slopes·X are what only the unknowns explain; their
    products over all rows and samples are the Schur complement, so that batches of neighbours add up to it.
    """
    linear = _linear(layout, stretch, motion, unknowns, chosen)
    torque = variances.torque
    each = list(zip(linear.slopes, linear.columns, torque, strict=True))
    follows = _MotionEquations(stretch, linear, variances)
    pull = _sensed_pull(stretch, motion, variances)
    for slope, residual, v in zip(linear.slopes, linear.residual, torque, strict=True):
        pull = pull + slope.T @ residual / v
    step = follows.solve(pull).reshape(motion.shape)
    x = follows.solve(np.sum([slope.T @ column / v for slope, column, v in each], axis=0))
    alone = [(column - slope @ x) / np.sqrt(v) for slope, column, v in each]
    whitened = [r / np.sqrt(v) for r, v in zip(linear.residual, torque, strict=True)]
    rows, samples = len(whitened[0]), len(stretch.channels["q"])
    count = int(np.clip(rows // _LEAST_ROWS, 1, pieces))
    edges = np.linspace(0, rows, count + 1).astype(int)
    size = len(chosen)
    matrix, right = np.zeros((count, size, size)), np.zeros((count, size))
    length = stretch.maker.plan.stride * stretch.maker.plan.decimation
    shape = (*motion.shape, size)
    for k, (begin, end) in enumerate(pairwise(edges)):
        for own, residual in zip(alone, whitened, strict=True):
            matrix[k] += own[begin:end].T @ own[begin:end]
            right[k] += own[begin:end].T @ residual[begin:end]
        here = slice(begin * length, samples if end == rows else end * length)
        right[k] -= x.T @ _sensed_pull(stretch, motion, variances, here)
        for design, variance in zip(stretch.spline.at, (variances.angle, variances.velocity), strict=True):
            if variance is not None:
                moved = np.einsum("sjp,j->sjp", _times(design[here], x.reshape(shape)), 1.0 / np.sqrt(variance))
                matrix[k] += np.einsum("sjp,sjq->pq", moved, moved, optimize=True)
    left = [r - slope @ step.reshape(-1) for r, slope in zip(linear.residual, linear.slopes, strict=True)]
    score, information = _scoring(linear, follows, left, torque)
    return _Reduced(matrix, right, step, score, information)


def _times(design: Sparse, x: Array) -> Array:
    """(samples, n, P) of x (K, n, P)."""
    return np.asarray(design @ x.reshape(len(x), -1)).reshape(-1, *x.shape[1:])


def _scoring(linear: _Linear, follows: _MotionEquations, left: list[Array], torque: Array) -> tuple[Array, Array]:
    """Score and information of the rows' variances v. With the motion eliminated the rows' covariance is inverted by
    P = (1 − J·H⁻¹·Jᵀ/v)/v, and ``left`` r is v·P times what they are off: the score is rᵀr/v² − tr P, the information
    tr P·P, of joint by joint. Traces by random signs (Hutchinson).
    """
    random = np.random.default_rng(0)
    n = len(torque)
    score, information = np.empty(n), np.empty((n, n))
    for joint, (slope, residual) in enumerate(zip(linear.slopes, left, strict=True)):
        # A row that counts for less has less of everything, so that its signs are smaller as well.
        signs = random.choice([-1.0, 1.0], size=(slope.shape[0], _DRAWS)) * np.sqrt(linear.weight[joint])[:, None]
        moved = follows.solve(slope.T @ signs / torque[joint])
        seen = [-(other @ moved) / v for other, v in zip(linear.slopes, torque, strict=True)]
        seen[joint] += signs / torque[joint]
        score[joint] = residual @ residual / torque[joint] ** 2 - np.sum(signs * seen[joint]) / _DRAWS
        information[:, joint] = [np.sum(x**2) / _DRAWS for x in seen]
    return score, (information + information.T) / 2.0
