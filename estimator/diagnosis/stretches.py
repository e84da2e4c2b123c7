"""From recordings to smoothed signals and what the given model leaves of each measured channel, on one grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.grains import rounding
from estimator.effects import Equation, Signals
from estimator.filtering import FilterPlan, convolve, motion_band, plan_filter, resample, smooth_motion
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

CHUNK = 16_384
"""Samples of the recording worked on at once."""
_KINEMATIC = 3.0
"""`plan_filter` leaves the kinematics flat to six times its band: a third of the rows' band leaves them flat to twice
the rows'."""
_WIDER = 5.0
"""The rows' band is this multiple of the motion's: the sign of a velocity, a ripple, a late channel act above it."""
_LEAST_BAND, _WIDEST_BAND = 10.0, 25.0
"""Hz"""


@dataclass(frozen=True)
class Channel:
    """One measured quantity that an equation of motion predicts."""

    equation: Equation
    index: int
    """The joint, or the component 0 … 5 of the wrench."""


@dataclass(frozen=True)
class Stretch:
    """A gapless piece of one recording."""

    recording: int
    signals: Signals
    residual: Array
    """(samples, channels) measured less the given model's."""
    rounding: Array
    """(samples, channels) a realisation of what the rounding of the angles to counts adds to the residual."""


@dataclass(frozen=True)
class Grid:
    """Rates that belong to one band."""

    band: float
    """Hz: half-power edge of the rows."""
    channels: tuple[Channel, ...]
    count: Array
    """(n,) rad of one count of each encoder, 0 where there is none."""

    def decimation(self, period: float) -> int:
        """Samples of `Stretch.signals` a row."""
        return max(1, int(1.0 / (2.0 * self.band * period)))


def rows_band(trajectories: Sequence[Trajectory]) -> float:
    """Hz: the band in which these recordings are compared with the model."""
    slowest = min(trajectory.rate for trajectory in trajectories)
    wanted = float(np.clip(_WIDER * motion_band(trajectories), _LEAST_BAND, _WIDEST_BAND))
    return min(wanted, 0.12 * slowest)


def channels_of(body: RigidBody, trajectories: Sequence[Trajectory]) -> tuple[Channel, ...]:
    """Torques of all joints; speeds as well where every recording measured them."""
    channels = [Channel("torque", joint) for joint in range(body.n)]
    if all(trajectory.dq is not None for trajectory in trajectories):
        channels += [Channel("velocity", joint) for joint in range(body.n)]
    return tuple(channels)


def stretches(body: RigidBody, grid: Grid, recording: int, trajectory: Trajectory) -> list[Stretch]:
    """All gapless pieces of one recording that are longer than the smoothing reaches."""
    plan = plan_filter(trajectory.rate, grid.band / _KINEMATIC)
    pieces = trajectory.segments(CHUNK, 2 * plan.edge)
    long_enough = [piece for piece in pieces if len(piece) > 2 * plan.edge + 16 * plan.stride]
    return [_stretch(body, grid, recording, trajectory, piece, plan) for piece in long_enough]


def _stretch(
    body: RigidBody, grid: Grid, recording: int, trajectory: Trajectory, piece: NDArray[np.intp], plan: FilterPlan
) -> Stretch:
    t = trajectory.t[piece]
    thin = slice(None, None, plan.stride)

    def smoothed(channel: Array) -> Array:
        return convolve(resample(t, channel[piece], plan.rate), plan.smooth)[thin]

    motion = smooth_motion(plan, resample(t, trajectory.q[piece], plan.rate), None, None)
    q, dq, ddq = motion.q[thin], motion.dq[thin], motion.ddq[thin]
    times = t[0] + (plan.edge + plan.stride * np.arange(len(q))) / plan.rate
    rigid = inverse_dynamics(body, body.prior(), q, dq, ddq)
    tau = smoothed(trajectory.tau)
    speed = None if trajectory.dq is None else smoothed(trajectory.dq)
    signals = Signals(body, times, q, dq, ddq, rigid, tau, speed)
    # The same motion with its rounding errors twice: what they add.
    smooth = motion.q
    error = np.pad(rounding(smooth, grid.count, np.random.default_rng(0)), ((plan.edge, plan.edge), (0, 0)), "reflect")
    twice = smooth_motion(plan, error, None, None)
    more = q + twice.q[thin], dq + twice.dq[thin], ddq + twice.ddq[thin]
    rigid_twice = inverse_dynamics(body, body.prior(), *more)
    residual, rounded = np.empty((2, len(q), len(grid.channels)))
    for k, channel in enumerate(grid.channels):
        j = channel.index
        if channel.equation == "torque":
            residual[:, k], rounded[:, k] = tau[:, j] - rigid[:, j], rigid[:, j] - rigid_twice[:, j]
        else:
            assert speed is not None
            residual[:, k], rounded[:, k] = speed[:, j] - dq[:, j], dq[:, j] - more[1][:, j]
    return Stretch(recording, signals, residual, rounded)
