"""From recordings to rows: regressor, terms and torque of each joint, filtered alike, decimated, summed."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.convolution import convolve_each
from estimator.filtering import (
    FLAT_TO_BAND,
    Decimator,
    FilterPlan,
    ThinnedMotion,
    plan_filter,
    resample,
    thinned_motion,
)
from estimator.regressor import regressor_blocks
from estimator.rigid_body import RigidBody
from estimator.standstill import motion_weight, rms_speeds, weight_without
from estimator.sums import Sums
from estimator.terms import Term
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_WIDTHS = np.array([0.003, 0.03, 0.15])
"""Widths of the friction sigmoid to choose from, as shares of the joint's rms speed."""

_FLAT_TO = 30.0
"""Hz to which the kinematics are flat at least, so that their kernels lose but a tenth of a second at the ends."""

CHUNK = 16_384
"""Samples worked on at once; memory does not grow beyond what they need."""


@dataclass(frozen=True)
class Layout:
    """The columns of each joint's rows: [base parameters that reach the joint | its terms | torque | instruments]."""

    body: RigidBody
    base: BaseParameters
    terms: tuple[tuple[Term, ...], ...]
    """Terms of each joint."""
    active: tuple[tuple[int, ...], ...]
    """For each joint the base parameters that act on its torque."""
    instruments: bool
    """Whether the same columns of the commanded motion follow the torque."""
    rest_speed: Array
    """(n,) rad/s below which a joint's rows do not count (`estimator.standstill`)."""
    crossover: Array | None
    """(n,) rad/s at which measured velocities take over from angles; see `estimator.filtering.thinned_motion`."""

    @property
    def size(self) -> int:
        """Unknowns: base parameters, then the terms of joint after joint."""
        return self.base.rank + sum(len(terms) for terms in self.terms)

    def unknowns(self, joint: int) -> list[int]:
        """Where the joint's columns stand among all unknowns."""
        before = self.base.rank + sum(len(terms) for terms in self.terms[:joint])
        return [*self.active[joint], *range(before, before + len(self.terms[joint]))]


def row_filter(rate: float, band: float) -> FilterPlan:
    """The filters of link identification. The band is ten times the motion's, so that kinematics flat to twice the band
    lose nothing; flat to more they would only let in the noise of accelerations, which grows as ω²."""
    return plan_filter(rate, band, flat=float(np.clip(_FLAT_TO / band, 2.0, FLAT_TO_BAND)))


def make_layout(
    body: RigidBody,
    base: BaseParameters,
    terms: Sequence[Sequence[Term]],
    instruments: bool = False,
    rest_speed: Array | None = None,
    crossover: Array | None = None,
) -> Layout:
    """Layout of an arm; which base parameters reach which joint follows from its geometry. Without ``rest_speed`` all
    samples count."""
    random = np.random.default_rng(1)
    q, dq, ddq = random.normal(0.0, 2.0, (3, 40, body.n))
    blocks = [block.copy() for _, block in regressor_blocks(body, q, dq, ddq)]
    magnitude = np.abs(np.concatenate(blocks, axis=2)).max(axis=2)[:, list(base.kept)]
    active = [tuple(np.flatnonzero(row > 1e-9 * magnitude.max()).tolist()) for row in magnitude]
    rest = np.zeros(body.n) if rest_speed is None else rest_speed
    return Layout(body, base, tuple(tuple(t) for t in terms), tuple(active), instruments, rest, crossover)


def friction_widths(trajectories: Sequence[Trajectory]) -> Array:
    """(n, 3) rad/s: widths of the friction sigmoid to choose from, by each joint's rms speed."""
    speed = rms_speeds(trajectories)
    return np.asarray(np.maximum(speed, 1e-3 * speed.max())[:, None] * _WIDTHS)


def sum_up(layout: Layout, trajectories: Sequence[Trajectory], band: float) -> Sums:
    """One pass over the recordings. ``band`` Hz is the half-power edge of the parallel low-pass."""
    sums = Sums(high_frequency=np.zeros(layout.body.n))
    for recording, trajectory in enumerate(trajectories):
        for rows, counted in trajectory_rows(layout, trajectory, band, sums):
            sums.add(rows, recording, counted)
    return sums


def trajectory_rows(
    layout: Layout, trajectory: Trajectory, band: float, sums: Sums
) -> Iterator[tuple[list[Array], Array]]:
    """Rows of one recording, segment by segment, and how much of each joint's rows counts (n, rows); counts samples and
    high-frequency torque in ``sums``."""
    plan = row_filter(trajectory.rate, band)
    rows_of = RowMaker(layout, plan)
    for piece in trajectory.segments(CHUNK, 2 * plan.edge, layout.instruments):
        if len(piece) < 2 * plan.edge + 4 * plan.stride * plan.decimation:
            continue
        channels = on_grid(trajectory, piece, plan.rate, layout.instruments)
        tau = channels["tau"]
        motion = thinned_motion(plan, channels["q"], channels.get("dq"), channels.get("ddq"), layout.crossover)
        inner = tau[plan.edge : len(tau) - plan.edge]
        desired = thinned_motion(plan, channels["q_desired"], None, None) if layout.instruments else None
        sums.samples += len(piece)
        sums.duration += len(inner) / plan.rate
        if sums.high_frequency is not None:
            sums.high_frequency += _above_band(tau, inner, plan)
        unusable = channels.get("unusable")
        usable = None if unusable is None else unusable[plan.edge : len(tau) - plan.edge].T <= 0.0
        yield rows_of(motion, inner, desired, usable)


def on_grid(trajectory: Trajectory, piece: NDArray[np.intp], rate: float, commanded: bool) -> dict[str, Array]:
    """The channels (samples, n) of a piece that were measured, by name, on a uniform grid."""
    t = trajectory.t[piece]
    named = {
        "q": trajectory.q,
        "tau": trajectory.tau,
        "dq": trajectory.dq,
        "ddq": trajectory.ddq,
        "q_desired": trajectory.q_desired if commanded else None,
        "unusable": None if trajectory.unusable is None else trajectory.unusable.astype(float),
    }
    return {name: resample(t, value[piece], rate) for name, value in named.items() if value is not None}


def _above_band(tau: Array, inner: Array, plan: FilterPlan) -> Array:
    """Sum of squares that white noise would leave in the decimated rows, judged by what lies above the band."""
    above = inner[:: plan.stride] - convolve_each(tau, [plan.smooth], plan.stride)[0]
    centre = plan.smooth[len(plan.smooth) // 2]
    passed = 1.0 - 2.0 * centre + float(plan.smooth @ plan.smooth)
    total = plan.stride * plan.decimation
    return np.asarray(np.mean(above**2, axis=0) * len(inner) / passed / total**2)


class RowMaker:
    """Turns smoothed segments into decimated rows."""

    def __init__(self, layout: Layout, plan: FilterPlan) -> None:
        self.layout, self.plan = layout, plan
        self.coarse = Decimator(plan.decimation)
        self.fine = Decimator(plan.stride * plan.decimation)

    def __call__(
        self, motion: ThinnedMotion, tau: Array, desired: ThinnedMotion | None, usable: NDArray[np.bool_] | None
    ) -> tuple[list[Array], Array]:
        length = self.plan.stride * self.plan.decimation
        weight = self.weight(motion.dq, usable)
        columns = self._columns(motion, weight)
        torque = self.fine(tau.T * weight)
        parts = [[own, torque[joint : joint + 1]] for joint, own in enumerate(columns)]
        if desired is not None:
            for part, instruments in zip(parts, self._columns(desired, weight), strict=True):
                part.append(instruments)
        return [np.concatenate(part) for part in parts], weight[:, ::length] ** 2

    def weight(self, dq: Array, usable: NDArray[np.bool_] | None) -> Array:
        """(n, samples) of each joint's equations: zero where it rests and where its torque says nothing."""
        length = self.plan.stride * self.plan.decimation
        weight = self._taper(len(dq)) * motion_weight(dq, self.layout.rest_speed, length)
        return weight if usable is None else weight * weight_without(~usable, length)

    def _taper(self, samples: int) -> Array:
        """Rises and falls over one row: cut off abruptly, the strong noise of accelerations above the band would spill
        into it, and the sums over coarse and fine samples would not agree at the ends."""
        taper = np.ones(samples)
        length = self.plan.stride * self.plan.decimation
        ramp = 0.5 - 0.5 * np.cos(np.pi * (np.arange(length) + 0.5) / length)
        taper[:length] *= ramp
        taper[-length:] *= ramp[::-1]
        return taper

    def _columns(self, motion: ThinnedMotion, weight: Array) -> list[Array]:
        """Each joint's columns of rigid body and terms, decimated: those linear in the motion from where the
        regressor is evaluated, the others from every sample (a sign's harmonics would fold, and an offset must be the
        same to the last digit as the friction of a joint that only moves one way)."""
        layout, stride = self.layout, self.plan.stride
        kept, sign = np.array(layout.base.kept), layout.base.sign
        thin, dq_thin, ddq_thin = motion.thinned.q, motion.thinned.dq, motion.thinned.ddq
        q, dq, ddq = (np.ascontiguousarray(x.T).T for x in (thin, dq_thin, ddq_thin))
        thin_weight = np.ascontiguousarray(weight[:, ::stride])
        columns = [kept[list(active)] for active in layout.active]
        signs = [sign[list(active)][:, None] for active in layout.active]
        straight = [[term for term in terms if term.linear] for terms in layout.terms]
        rows = [np.empty((len(a) + len(b), len(q))) for a, b in zip(layout.active, straight, strict=True)]
        for span, block in regressor_blocks(layout.body, q, dq, ddq):
            for joint, own in enumerate(columns):
                factor = signs[joint] * thin_weight[joint, span]
                np.multiply(block[joint, own], factor, out=rows[joint][: len(own), span])
        for joint, terms in enumerate(straight):
            for k, term in enumerate(terms, len(columns[joint])):
                np.multiply(term.column(dq[:, joint], ddq[:, joint]), thin_weight[joint], out=rows[joint][k])
        return [self._with_others(self.coarse(x), joint, motion.dq[:, joint], weight) for joint, x in enumerate(rows)]

    def _with_others(self, decimated: Array, joint: int, dq: Array, weight: Array) -> Array:
        """The columns of terms that are not linear in the motion, put in their places among the others."""
        terms = self.layout.terms[joint]
        others = [k for k, term in enumerate(terms) if not term.linear]
        if not others:
            return decimated
        fine = self.fine(np.array([terms[k].column(dq, dq) for k in others]) * weight[joint])
        first = len(self.layout.active[joint])
        order = [k for k, term in enumerate(terms) if term.linear] + others
        result = np.empty((first + len(terms), decimated.shape[1]))
        result[:first] = decimated[:first]
        result[[first + k for k in order]] = np.concatenate([decimated[first:], fine])
        return result
