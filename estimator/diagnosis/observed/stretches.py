"""From recordings to smoothed signals and what the given model leaves of each measured channel, on one grid."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.convolution import convolve
from estimator.diagnosis.observed.grains import counts, rounding
from estimator.diagnosis.observed.noise import ORDER
from estimator.effects import Equation, Signals
from estimator.filtering import FilterPlan, Motion, motion_band, plan_filter, resample, smooth_motion
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

LEAST_ROWS = 20
"""Of a piece that tells anything, behind the noise's own filter."""
CHUNK = 16_384
"""Samples of the recording worked on at once."""
KINEMATIC = 2.0
"""Times the rows' band, to which the kinematics are flat."""
_DEGREE = 5
"""Of the polynomial that does so."""
_PERIODS = 3.0
"""Of the highest frequency of the calm motion, by which its ends are continued."""
_WIDER = 5.0
"""The rows' band is this multiple of the motion's: the sign of a velocity, a ripple, a late channel act above it."""
_LEAST_BAND, _WIDEST_BAND = 10.0, 25.0
"""Hz"""
_CALM, _LEAST_CALM = 3.0, 2.0
"""The motion from which columns are made: to this multiple of the motion's band, and at least to so many Hz. Noise of
the angles in a column is the same noise as in the residual, and their product would be taken for evidence."""
_UNSURE = 0.5
"""Periods of its highest frequency, at the ends of a recording that begins or ends in motion, for which the calm motion
may be unsure …"""
_FAR = 4.0
"""… where it differs from the motion by so many times what it does between."""
_OWN = 0.5
"""Of that: once and a half the motion's band holds all but a hundredth of its accelerations."""


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
    power: Array
    """(channels,) mean square of what was measured."""


@dataclass(frozen=True)
class Grid:
    """Rates that belong to one band."""

    band: float
    """Hz: half-power edge of the rows."""
    channels: tuple[Channel, ...]
    count: Array
    """(n,) rad of one count of each encoder, 0 where there is none."""
    motion: float
    """Hz up to which the angles tell more than noise: hypotheses' columns are made from the motion below."""

    def slower(self) -> Grid:
        """The same with columns of the motion's own band alone, where it stands far above the angles' errors."""
        return replace(self, motion=_OWN * self.motion)

    def decimation(self, period: float) -> int:
        """Samples of `Stretch.signals` a row."""
        return max(1, int(1.0 / (2.0 * self.band * period)))


def make_grid(body: RigidBody, trajectories: Sequence[Trajectory]) -> Grid:
    """The bands in which these recordings are compared with the model."""
    slowest = min(trajectory.rate for trajectory in trajectories)
    moving = motion_band(trajectories)
    band = min(float(np.clip(_WIDER * moving, _LEAST_BAND, _WIDEST_BAND)), 0.12 * slowest)
    motion = float(np.clip(_CALM * moving, _LEAST_CALM, band))
    return Grid(band, channels_of(body, trajectories), counts(trajectories), motion)


def channels_of(body: RigidBody, trajectories: Sequence[Trajectory]) -> tuple[Channel, ...]:
    """Torques of all joints; speeds as well where every recording measured them."""
    channels = [Channel("torque", joint) for joint in range(body.n)]
    if all(trajectory.dq is not None for trajectory in trajectories):
        channels += [Channel("velocity", joint) for joint in range(body.n)]
    return tuple(channels)


def stretches(body: RigidBody, grid: Grid, recording: int, trajectory: Trajectory) -> list[Stretch]:
    """All gapless pieces of one recording that are long enough to judge."""
    plan = plan_filter(trajectory.rate, grid.band, flat=KINEMATIC)
    return [_stretch(body, grid, recording, trajectory, piece, plan) for piece in gapless(grid, plan, trajectory)]


def gapless(grid: Grid, plan: FilterPlan, trajectory: Trajectory) -> list[NDArray[np.intp]]:
    """The samples of each piece that is long enough to judge."""
    row = plan.stride * grid.decimation(plan.stride / plan.rate)
    least = 2 * plan.edge + (ORDER + LEAST_ROWS) * row
    return [piece for piece in trajectory.segments(CHUNK, 2 * plan.edge) if len(piece) >= least]


def told_by(pieces: list[Stretch], name: str) -> list[Stretch]:
    """The same pieces. Raises InputError, naming a recording, where there are none."""
    if not pieces:
        raise InputError(name, "has no gapless stretch long enough to judge", "record at least some seconds of motion")
    return pieces


def _stretch(
    body: RigidBody, grid: Grid, recording: int, trajectory: Trajectory, piece: NDArray[np.intp], plan: FilterPlan
) -> Stretch:
    t = trajectory.t[piece]
    thin = slice(None, None, plan.stride)

    def smoothed(channel: Array) -> Array:
        return convolve(resample(t, channel[piece], plan.rate), plan.smooth)[thin]

    measured = resample(t, trajectory.q[piece], plan.rate)
    motion = smooth_motion(plan, measured, None, None)
    q, dq, ddq = motion.q[thin], motion.dq[thin], motion.ddq[thin]
    times = t[0] + (plan.edge + plan.stride * np.arange(len(q))) / plan.rate
    rigid = inverse_dynamics(body, body.prior(), q, dq, ddq)
    tau = smoothed(trajectory.tau)
    speed = None if trajectory.dq is None else smoothed(trajectory.dq)
    calm = calm_motion(grid, plan, measured)
    still = calm.q[thin], calm.dq[thin], calm.ddq[thin]
    # Without the measured torque: in a column its noise is the residual's, and would be taken for evidence.
    rigid_still, warm = inverse_dynamics(body, body.prior(), *still), temperatures_at(trajectory, times)
    signals = Signals(body, times, *still, rigid_still, dq_measured=speed, temperature=warm)
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
    size = np.array([np.mean((tau if c.equation == "torque" else dq)[:, c.index] ** 2) for c in grid.channels])
    sure = _sure(still[2], ddq, int(_UNSURE * plan.rate / plan.stride / grid.motion))
    return Stretch(recording, signals.part(sure, times[sure]), residual[sure], rounded[sure], size)


def temperatures_at(trajectory: Trajectory, times: Array) -> Array | None:
    """(samples, n) °C of the joints at these times, straight between what was recorded; NaN of those without."""
    if trajectory.temperature is None:
        return None
    result = np.full((len(times), trajectory.temperature.shape[1]), np.nan)
    for joint, own in enumerate(trajectory.temperature.T):
        told = np.isfinite(own)
        if told.any():
            result[:, joint] = np.interp(times, trajectory.t[told], own[told])
    return result


def _sure(calm: Array, ddq: Array, most: int) -> slice:
    """The samples but those, at most so many at either end, where the calm accelerations (samples, n) differ from the
    motion's by far more than between the ends: what the reflection there does not continue."""
    apart = np.abs(calm - ddq)
    inner = apart[most : len(apart) - most]
    if len(inner) < most:
        return slice(0, len(apart))
    far = np.any(apart > _FAR * np.sqrt(np.mean(inner**2, axis=0)), axis=1)
    first, last = np.flatnonzero(far[:most]), np.flatnonzero(far[len(far) - most :])
    return slice(int(first[-1]) + 1 if len(first) else 0, len(far) - most + int(last[0]) if len(last) else len(far))


def mean_power(pieces: Sequence[Stretch]) -> Array:
    """(channels,) mean square of what was measured, over all stretches."""
    return np.average([piece.power for piece in pieces], axis=0, weights=[piece.signals.samples for piece in pieces])


def _reflected(measured: Array, period: int, more: int, rate: float) -> Array:
    """(more, n) samples after the last: oddly reflected, as is right where a motion rests. One that goes on loses its
    acceleration at once, and smoothed, for most of a period before."""
    return np.pad(measured, ((0, more), (0, 0)), mode="reflect", reflect_type="odd")[len(measured) :]


def _going_on(measured: Array, period: int, more: int, rate: float) -> Array:
    """(more, n) samples after the last: with the speed and the acceleration of a polynomial through the last two
    ``period`` samples, of which the acceleration fades within one. A motion that begins or ends there is none."""
    last = measured[-max(2 * period, 2 * _DEGREE) :]
    span, powers = len(last) / rate, np.arange(_DEGREE + 1)
    told = np.linalg.lstsq(np.vander(np.arange(1 - len(last), 1) / len(last), len(powers), increasing=True), last)[0]
    s = np.arange(1, more + 1) / rate
    of_ddq = powers[2:] * (powers[2:] - 1) * np.vander(s / span, _DEGREE - 1, increasing=True) / span**2
    fades = np.cos(0.5 * np.pi * np.minimum(s * rate / max(period, 1), 1.0)) ** 2
    slope = told[1] / span + np.cumsum(fades[:, None] * (of_ddq @ told[2:]), axis=0) / rate
    return np.asarray(told[0] + np.cumsum(slope, axis=0) / rate)


def calm_motion(grid: Grid, plan: FilterPlan, measured: Array) -> Motion:
    """The motion below `Grid.motion`, on the samples that ``plan``'s kernels reach, smoothed by its spectrum: a kernel
    as long as this band asks would cost the ends. Beyond each end it goes on in that way which leaves less of the
    angles near it, joint by joint."""
    period, rate = int(plan.rate / grid.motion), plan.rate
    more = min(len(measured) - 1, int(_PERIODS * rate / grid.motion))
    ways = [
        (way(measured[::-1], period, more, rate)[::-1], way(measured, period, more, rate))
        for way in (_reflected, _going_on)
    ]
    told, near = smooth_motion(plan, measured, None, None).q, max(int(_UNSURE * rate / grid.motion), 1)
    apart = [np.square(_smoothed(grid, plan, measured, *way).q - told) for way in ways]
    before, after = (
        np.where(np.less(*(own[end].sum(axis=0) for own in apart)), *(way[side] for way in ways))
        for side, end in enumerate((slice(near), slice(-near, None)))
    )
    return _smoothed(grid, plan, measured, before, after)


def _smoothed(grid: Grid, plan: FilterPlan, measured: Array, before: Array, after: Array) -> Motion:
    """`calm_motion` of one that goes on so."""
    padded, samples, more = np.vstack([before, measured, after]), len(measured), len(before)
    # Without the line through its ends the padded motion is periodic without a jump.
    count = len(padded)
    drift = (padded[-1] - padded[0]) / (count - 1)
    line = padded[0] + np.arange(count)[:, None] * drift
    spectrum = np.fft.rfft(padded - line, axis=0)
    frequency = np.fft.rfftfreq(count, 1.0 / plan.rate)[:, None]
    passed = 0.5 + 0.5 * np.cos(np.pi * np.clip(frequency / grid.motion - 1.0, 0.0, 1.0))
    omega = 2.0j * np.pi * frequency
    inner = slice(more + plan.edge, more + samples - plan.edge)

    def back(order: int) -> Array:
        return np.asarray(np.fft.irfft(spectrum * passed * omega**order, count, axis=0)[inner])

    return Motion(back(0) + line[inner], back(1) + drift * plan.rate, back(2))
