"""Recordings thinned to what hypotheses about them are tried on: smoothed kinematics and torques, a few a second."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.convolution import convolve
from estimator.filtering import plan_filter, resample, smooth_motion
from estimator.plausibility.coarse import coarse
from estimator.plausibility.doubt import Kind
from estimator.regressor import torque_regressor
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK
from estimator.standstill import rest_speeds, rms_speeds
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_MOST_SAMPLES = 700
_SECONDS = 600.0
"""Of recordings looked at …"""
_AT_ONCE = 10.0
"""… in pieces of so many, spread over all of them: in its first part a joint may stand and another one move."""
_FILTER_BAND = 0.5
"""Hz: kinematics and torques are smoothed alike, flat to six times this …"""
_FLAT = 6.0
"""… and wider where recordings are so short that the smoothing would leave less than half of the longest; of each,
where joints that move hardly do so in the longest."""
_STILL = 0.3
"""Of its rms speed in all recordings: a joint that is slower in a snapshot does not show there what it does."""
_WIDEST_BAND = 4.0
"""Hz; what is shorter than such a filter's ends is not looked at."""
TERMS = 4
"""Of each joint, beside the rigid body."""
_RIDGE = 1e-9
_SPOILT = 0.01
"""Share of the smoothing kernel that may rest on unusable torques."""
_NARROW = 0.02
"""rad/s: width of the friction sigmoid; joints at rest are left out anyway."""


ORDERS: dict[Kind, tuple[str, ...]] = {
    "joint order": ("q", "dq", "ddq", "tau", "moving", "usable"),
    "torque order": ("tau", "usable"),
    "angle order": ("q", "dq", "ddq", "moving"),
}
"""What of a snapshot is exchanged where channels came in another order."""
CHANNELS: dict[Kind, str] = {"joint order": "joints", "torque order": "torques", "angle order": "angles"}


@dataclass(frozen=True)
class Snapshot:
    """(samples, n) each, joints as the body has them; ``moving`` where the joint does not rest, ``usable`` where its
    torque says something."""

    q: Array
    dq: Array
    ddq: Array
    tau: Array
    moving: NDArray[np.bool_]
    usable: NDArray[np.bool_]
    band: float
    """Hz to which it is flat."""

    def of(self, kind: Kind, order: Sequence[int]) -> Snapshot:
        """The same with the channels of a kind of `ORDERS` in another order."""
        return replace(self, **{name: getattr(self, name)[:, list(order)] for name in ORDERS[kind]})


def take(trajectories: Sequence[Trajectory]) -> Snapshot | None:
    """A snapshot of some recordings; None when they have no gapless half of a second."""
    limits, speeds = rest_speeds(trajectories), rms_speeds(trajectories)
    trajectories = [coarse(trajectory) for trajectory in trajectories]
    narrow, wide = _bands(trajectories)
    shot = _smoothed(trajectories, narrow, limits)
    if wide > narrow and (shot is None or np.any(np.sqrt(np.mean(shot.dq**2, axis=0)) < _STILL * speeds)):
        return _smoothed(trajectories, wide, limits)
    return shot


def _smoothed(trajectories: Sequence[Trajectory], band: float, limits: Array) -> Snapshot | None:
    """``limits`` (n,) rad/s: slower is at rest."""
    parts: list[list[Array]] = []
    whole_time = sum(trajectory.samples / trajectory.rate for trajectory in trajectories)
    every = max(1, round(whole_time / _SECONDS))
    for trajectory in trajectories:
        plan = plan_filter(trajectory.rate, band)
        longest = CHUNK if every == 1 else max(round(_AT_ONCE * trajectory.rate), 4 * plan.edge)
        long_enough = [piece for piece in trajectory.segments(longest, 0) if len(piece) > 2 * plan.edge + 1]
        for piece in long_enough[::every]:
            t = trajectory.t[piece]
            q = resample(t, trajectory.q[piece], plan.rate)
            motion = smooth_motion(plan, q, None, None)
            tau = convolve(resample(t, trajectory.tau[piece], plan.rate), plan.smooth)
            bad = np.zeros(trajectory.tau.shape) if trajectory.unusable is None else trajectory.unusable.astype(float)
            # A smoothed torque is as good as the worst sample behind it.
            usable = convolve(resample(t, bad[piece], plan.rate), np.abs(plan.smooth)) < _SPOILT
            whole = usable.astype(float)
            parts.append([motion.q, motion.dq, motion.ddq, tau, whole])
    if not parts:
        return None
    q, dq, ddq, tau, usable = (np.concatenate(x) for x in zip(*parts, strict=True))
    thinned = slice(None, None, -(-len(q) // _MOST_SAMPLES))
    moving = np.abs(dq[thinned]) >= limits
    told = usable[thinned].astype(np.bool_)
    return Snapshot(q[thinned], dq[thinned], ddq[thinned], tau[thinned], moving, told, _FLAT * band)


def joined(shots: Sequence[Snapshot]) -> Snapshot:
    """All of them in one, thinned to what one of them has; flat to where the widest is."""
    every = slice(None, None, len(shots))
    kept = {name: np.concatenate([getattr(shot, name)[every] for shot in shots]) for name in ORDERS["joint order"]}
    return Snapshot(**kept, band=max(shot.band for shot in shots))


def _bands(trajectories: Sequence[Trajectory]) -> tuple[float, float]:
    """Hz of filters whose two ends take no more than half of the longest recording, and of any that is long enough for
    the widest."""
    ends = max(2 * plan_filter(t.rate, _FILTER_BAND).edge / t.rate for t in trajectories)
    lengths = [float(t.t[-1] - t.t[0]) for t in trajectories]
    least = 2.0 * ends * _FILTER_BAND / _WIDEST_BAND
    looked_at = [length for length in lengths if length >= least] or [least]

    def band(length: float) -> float:
        return _FILTER_BAND * max(1.0, 2.0 * ends / length)

    return band(max(looked_at)), band(min(looked_at))


@dataclass(frozen=True)
class Fit:
    """A plain least-squares fit of a snapshot."""

    unknowns: Array
    """Base parameters, then viscous and Coulomb friction, rotor inertia and offset of joint after joint."""
    spread: Array
    """(unknowns, rows) by which the unknowns' errors are made of independent ones of size one, a row each."""
    relative: Array
    """(n,) rms of the residual over that of the torque, where the joint moves."""

    @property
    def misfit(self) -> float:
        """Geometric mean over the joints: by likelihood, each joint judged by its own noise."""
        return float(np.exp(np.mean(np.log(np.maximum(self.relative, 1e-9)))))


def fit(body: RigidBody, base: BaseParameters, shot: Snapshot) -> Fit | None:
    """Base parameters, friction, rotor inertia and offset of each joint; None when the rows are too few to say."""
    n, rank, extra = body.n, base.rank, TERMS
    full = base.select(torque_regressor(body, shot.q, shot.dq, shot.ddq))
    terms = friction_terms(shot)
    rows, right, owners = [], [], []
    for joint in range(n):
        here = shot.moving[:, joint] & shot.usable[:, joint]
        weight = 1.0 / max(float(np.sqrt(np.mean(shot.tau[:, joint] ** 2))), 1e-12)
        block = np.zeros((int(here.sum()), rank + extra * n))
        block[:, :rank] = full[here, joint]
        block[:, rank + extra * joint : rank + extra * (joint + 1)] = terms[here, joint]
        rows.append(weight * block)
        right.append(weight * shot.tau[here, joint])
        owners.append(np.full(len(block), joint))
    matrix, target, owner = np.concatenate(rows), np.concatenate(right), np.concatenate(owners)
    if len(target) < 3 * matrix.shape[1]:
        return None
    scale = np.linalg.norm(matrix, axis=0)
    scale[scale == 0.0] = 1.0
    # Hypotheses are told apart by percents of the torque: the normal equations are exact enough, and quick.
    scaled = matrix / scale
    inverse = np.linalg.inv(scaled.T @ scaled + _RIDGE * np.eye(len(scale))) / scale[:, None]
    unknowns = inverse @ (scaled.T @ target)
    residual = target - matrix @ unknowns
    errors = np.array([rms(residual[owner == j]) for j in range(n)])
    relative = errors / np.maximum(np.array([rms(target[owner == j]) for j in range(n)]), 1e-12)
    return Fit(unknowns, inverse @ (scaled.T * errors[owner]), relative)


def friction_terms(shot: Snapshot) -> Array:
    """(samples, n, TERMS) viscous and Coulomb friction, rotor inertia and offset of each joint, in that order."""
    return np.stack([shot.dq, np.tanh(shot.dq / _NARROW), shot.ddq, np.ones_like(shot.dq)], axis=2)


def inertias(body: RigidBody, base: BaseParameters, shot: Snapshot, found: Fit) -> tuple[Array, Array]:
    """(n,) each: the mean diagonal of the fitted mass matrix with the rotor's; and how many times its torque exceeds
    the residual, or the inertia its standard error where that is less."""
    inertia, clear = np.empty(body.n), np.empty(body.n)
    rest = np.zeros_like(shot.q)
    gravity = base.select(torque_regressor(body, shot.q, rest, rest))
    for joint in range(body.n):
        unit = rest.copy()
        unit[:, joint] = 1.0
        column = base.select(torque_regressor(body, shot.q, rest, unit))[:, joint] - gravity[:, joint]
        weights = np.zeros(len(found.unknowns))
        weights[: base.rank] = np.mean(column, axis=0)
        weights[base.rank + TERMS * joint + 2] = 1.0
        inertia[joint] = float(weights @ found.unknowns)
        error = float(np.linalg.norm(weights @ found.spread))
        noise = found.relative[joint] * rms(shot.tau[:, joint])
        told = min(rms(shot.ddq[:, joint]) / max(noise, 1e-12), 1.0 / max(error, 1e-12))
        clear[joint] = abs(inertia[joint]) * told
    return inertia, clear


def rms(x: Array) -> float:
    """Of all its values; 0 of none."""
    return float(np.sqrt(np.mean(x**2))) if x.size else 0.0
