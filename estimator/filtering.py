"""Zero-phase filters: what is done to the torque is done to every column of the regressor, sample for sample.

Any linear operation that both sides of tau = K·psi share leaves the equation true; an operation on one side alone does
not, and the difference looks like friction or elasticity. Two stages:

1. *Kinematics.* Angles are smoothed and differentiated by one family of kernels (a Kaiser-windowed sinc and its
   derivatives), flat to six times the band of stage 2: what they take from the
   motion is then far below a thousandth of the torque.
2. *Parallel decimation.* The rows of [regressor | torque] go through a root-raised-cosine low-pass and are decimated to
   twice its band. Its squared response sums to one over the aliases, so white noise stays white: least squares on the
   decimated rows wastes nothing and needs no correction for the filter's own correlation.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view
from numpy.typing import NDArray
from scipy.fft import rfft
from scipy.signal import detrend, lfilter
from scipy.signal.windows import hann

from estimator.convolution import convolve, convolve_each
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_STOP_BAND_DB = 100.0
"""What is left beyond the stop band folds back when a kernel is sampled, times frequency squared in the curvature."""
FLAT_TO_BAND = 6.0
"""The kinematics' low-pass is flat to this multiple of the parallel low-pass' band, and closed at twice that."""
_ROLL_OFF = 0.5
_ROWS_AT_ONCE = 8
"""Rows that a decimation works on together: they stay in the processor's cache."""
_PIECE = 12
"""Outputs of a decimation that one row of its matrix product gives."""
_SPAN = 12
"""Length of the decimating kernel in output samples."""


@dataclass(frozen=True)
class FilterPlan:
    """Rates and kernels for recordings of one sampling rate. Make it with `plan_filter`."""

    rate: float
    """Hz of the uniform grid that the recording is brought onto."""
    band: float
    """Hz: half-power edge of the parallel low-pass."""
    stride: int
    """The regressor is evaluated at every stride-th sample of the grid."""
    decimation: int
    """Evaluations a decimated row."""
    smooth: Array
    """Odd-length kernel of the kinematics' low-pass."""
    slope: Array
    """Its derivative, 1/s."""
    curvature: Array
    """Its second derivative, 1/s²."""

    @property
    def edge(self) -> int:
        """Samples at either end of a segment whose kinematics are unknown."""
        return len(self.smooth) // 2

    @property
    def row_rate(self) -> float:
        """Decimated rows a second."""
        return self.rate / (self.stride * self.decimation)


def plan_filter(rate: float, band: float, stride_limit: int = 8, flat: float = FLAT_TO_BAND) -> FilterPlan:
    """Kernels for a sampling rate (Hz) and a band (Hz); the band is lowered to what the rate can carry. The kinematics
    are flat to ``flat`` times the band."""
    band = min(band, 0.2 * rate)
    passes, stops = min(flat * band, 0.3 * rate), min(2.0 * flat * band, 0.48 * rate)
    half = int(np.ceil((_STOP_BAND_DB - 7.95) / (14.36 * (stops - passes) / rate) / 2))
    smooth, slope, curvature = _kernels(half, (passes + stops) / 2, rate)
    total = max(1, int(rate / (2.0 * band)))
    # Folding of what the kinematics pass must end above the decimating low-pass and its slope, by the band once more
    # for what products with the motion move.
    allowed = range(1, max(1, min(stride_limit, int(rate / (stops + (2.0 + _ROLL_OFF) * band)))) + 1)
    # Of the strides that carry the kinematics the longest that makes up the whole decimation, but for a tenth.
    stride = max(s for s in allowed if s * (total // s) >= 0.9 * total)
    decimation = max(1, total // stride)
    return FilterPlan(rate, rate / (2.0 * stride * decimation), stride, decimation, smooth, slope, curvature)


@lru_cache(maxsize=16)
def _kernels(half: int, cutoff: float, rate: float) -> tuple[Array, Array, Array]:
    """A windowed-sinc low-pass and its first two derivatives: of all kernels of this length the ones whose responses
    are nearest ω and −ω² times the low-pass', in relative terms; each exact on polynomials of its own degree.

    (Derivatives of the windowed sinc itself miss the window's small steps at its ends: half a percent of ω².)
    """
    samples = np.arange(-half, half + 1)
    smooth = np.sinc(2.0 * cutoff / rate * samples) * np.kaiser(len(samples), 0.1102 * (_STOP_BAND_DB - 8.7))
    smooth /= smooth.sum()
    beyond = samples[half + 1 :]
    omega = np.linspace(0.0, np.pi, 16 * half + 1)[1:]
    response = smooth[half] + 2.0 * np.cos(np.outer(omega, beyond)) @ smooth[half + 1 :]
    weight = 1.0 / np.minimum(omega, 2.0 * np.pi * cutoff / rate)
    tail = np.linalg.lstsq(
        -2.0 * np.sin(np.outer(omega, beyond)) * weight[:, None], omega * response * weight, rcond=None
    )[0]
    slope = np.concatenate([-tail[::-1], [0.0], tail])
    slope = slope / -(slope @ samples) * rate
    weight = weight**2
    # Without a constant: an angle at rest has no acceleration, to the last digit.
    tail = np.linalg.lstsq(
        2.0 * (np.cos(np.outer(omega, beyond)) - 1.0) * weight[:, None], -(omega**2) * response * weight, rcond=None
    )[0]
    curvature = np.concatenate([tail[::-1], [-2.0 * tail.sum()], tail])
    curvature = curvature * 2.0 / (curvature @ samples**2) * rate**2
    return smooth, slope, curvature


def root_raised_cosine(decimation: int) -> Array:
    """Kernel of unit gain at rest for a decimation by this factor, centred at the middle of its 12·decimation taps.

    White noise of variance v comes out white, with variance v / decimation.
    """
    length = _SPAN * decimation
    u = (np.arange(length) - length / 2) / decimation
    r = _ROLL_OFF
    with np.errstate(divide="ignore", invalid="ignore"):
        numerator = np.sin(np.pi * u * (1 - r)) + 4 * r * u * np.cos(np.pi * u * (1 + r))
        kernel = numerator / (np.pi * u * (1 - (4 * r * u) ** 2))
    kernel[np.abs(u) < 1e-12] = 1 - r + 4 * r / np.pi
    singular = np.abs(np.abs(4 * r * u) - 1) < 1e-9
    kernel[singular] = (
        r / np.sqrt(2) * ((1 + 2 / np.pi) * np.sin(np.pi / (4 * r)) + (1 - 2 / np.pi) * np.cos(np.pi / (4 * r)))
    )
    # Brought smoothly to zero, the kernel means the same filter whichever samples of it are taken.
    kernel *= np.cos(np.pi * u / _SPAN) ** 2
    return np.asarray(kernel / kernel.sum())


class Decimator:
    """The parallel filter as matrix products: rows (channels, N) → (channels, ceil(N / decimation)).

    Output k is centred at sample k·decimation. Beyond the ends the rows count as zero, for regressor and torque
    alike, so the equation stays true there too. Overlapping pieces of the rows times a band matrix that holds the
    kernel once for each of a piece's outputs.
    """

    def __init__(self, decimation: int) -> None:
        self.decimation = decimation
        self._band = np.zeros((_PIECE + _SPAN - 1, decimation, _PIECE))
        kernel = root_raised_cosine(decimation).reshape(_SPAN, decimation)
        for output in range(_PIECE):
            self._band[output : output + _SPAN, :, output] = kernel

    def __call__(self, rows: Array) -> Array:
        if self.decimation == 1:
            return rows
        channels, samples = rows.shape
        outputs = -(-samples // self.decimation)
        pieces, reach = -(-outputs // _PIECE), (_PIECE + _SPAN - 1) * self.decimation
        lead = (_SPAN // 2) * self.decimation
        at_once = min(_ROWS_AT_ONCE, channels)
        padded = np.zeros((at_once, pieces * _PIECE * self.decimation + reach))
        windows = sliding_window_view(padded, reach, axis=1)[:, : -self.decimation : _PIECE * self.decimation]
        band = self._band.reshape(reach, _PIECE)
        result = np.empty((channels, outputs))
        for first in range(0, channels, at_once):
            own = rows[first : first + at_once]
            padded[: len(own), lead : lead + samples] = own
            product = np.ascontiguousarray(windows[: len(own)]).reshape(-1, reach) @ band
            result[first : first + at_once] = product.reshape(len(own), -1)[:, :outputs]
        return result


@dataclass(frozen=True)
class Motion:
    """Smoothed kinematics on the uniform grid: (samples, n) each, the ends that the kernel cannot reach cut off."""

    q: Array
    dq: Array
    ddq: Array


def smooth_motion(
    plan: FilterPlan, q: Array, dq: Array | None, ddq: Array | None, crossover: Array | None = None
) -> Motion:
    """Kinematics of one uniformly sampled segment; what was not measured is differentiated.

    ``crossover`` (n,) rad/s of each joint joins measured velocities with differentiated angles: below it the angles
    are trusted, above it the velocities (see `estimator.channel_noise`). None: the velocities as they were measured.
    """
    # Relative to the first angle, so that a joint at rest has no velocity at all, not even one of rounding.
    smooth, slope, curvature = convolve_each(q - q[0], [plan.smooth, plan.slope, plan.curvature])
    smooth += q[0]
    if dq is None or (crossover is not None and np.all(np.isinf(crossover))):
        first, second = slope, curvature
    else:
        first, second = convolve_each(dq, [plan.smooth, plan.slope])
        crossover = np.zeros(q.shape[1]) if crossover is None else crossover
        for joint in np.flatnonzero(crossover > 0.0):
            off = np.array([slope[:, joint] - first[:, joint], curvature[:, joint] - second[:, joint]])
            slow = _slow_part(off, float(np.exp(-crossover[joint] / plan.rate)))
            first[:, joint] += slow[0]
            second[:, joint] += slow[1]
    if ddq is not None:
        second = convolve(ddq, plan.smooth)
    return Motion(smooth, first, second)


@dataclass(frozen=True)
class ThinnedMotion:
    """Kinematics at every ``stride``-th sample of the grid, where the regressor is evaluated, and the velocities at
    every sample, for what is not linear in them."""

    thinned: Motion
    dq: Array
    """(samples, n)"""


def thinned_motion(
    plan: FilterPlan, q: Array, dq: Array | None, ddq: Array | None, crossover: Array | None = None
) -> ThinnedMotion:
    """As `smooth_motion`, but angles and accelerations only where they are used: much of its time is saved."""
    stride, at_rest = plan.stride, q - q[0]
    smooth, second = convolve_each(at_rest, [plan.smooth, plan.curvature], stride)
    smooth += q[0]
    if dq is None or (crossover is not None and np.all(np.isinf(crossover))):
        first = convolve_each(at_rest, [plan.slope])[0]
    else:
        curvature, second = second, convolve_each(dq, [plan.slope], stride)[0]
        first = convolve_each(dq, [plan.smooth])[0]
        joined = np.flatnonzero(np.zeros(q.shape[1]) if crossover is None else crossover)
        if crossover is not None and len(joined):
            slope = convolve_each(at_rest[:, joined], [plan.slope])[0]
            for k, joint in enumerate(joined):
                decay = crossover[joint] / plan.rate
                first[:, joint] += _slow_part(slope[:, k] - first[:, joint], float(np.exp(-decay)))
                off = curvature[:, joint] - second[:, joint]
                second[:, joint] += _slow_part(off, float(np.exp(-decay * stride)))
    if ddq is not None:
        second = convolve_each(ddq, [plan.smooth], stride)[0]
    return ThinnedMotion(Motion(smooth, first[::stride], second), first)


def _slow_part(x: Array, pole: float) -> Array:
    """Zero-phase low-pass 1/(1 + (ω/ω_c)²) along the last axis, pole = exp(−ω_c/rate); beyond the ends x counts as
    zero."""
    if pole == 0.0:
        return x
    forward = lfilter([1.0], [1.0, -pole], x)
    backward = lfilter([1.0], [1.0, -pole], x[..., ::-1])[..., ::-1]
    return np.asarray((forward + backward - x) * (1.0 - pole) / (1.0 + pole))


def resample(t: Array, channels: Array, rate: float) -> Array:
    """Channels (samples, k) of jittered time onto a uniform grid, linearly; untouched when they are on one already."""
    count = round((t[-1] - t[0]) * rate) + 1
    grid = t[0] + np.arange(count) / rate
    if count == len(t) and np.abs(grid - t).max() < 0.02 / rate:
        return channels
    grid = grid[grid <= t[-1]]
    left = np.clip(np.searchsorted(t, grid, side="right") - 1, 0, len(t) - 2)
    weight = ((grid - t[left]) / (t[left + 1] - t[left]))[:, None]
    return np.asarray(channels[left] * (1.0 - weight) + channels[left + 1] * weight)


_ABOVE_FLOOR = 30.0
"""Times the median of its surroundings: a line of pure noise exceeds it once in 10⁹."""
_FLOOR_BINS = 64
"""At least, in which a floor is looked for."""
_SHAKING = 0.02
"""Of the velocities' energy."""
_NO_MOTION = 50.0
"""Hz, above which no arm is moved on purpose: what a servo that creeps or stands trembles with."""
_STANDS = 5e-4
"""Of the mean square speed of the fastest joint of the fastest recording: one that moves less tells no band …"""
_CREEPS = 0.01
"""… nor one that moves less than this share of its own in its fastest recording."""


def motion_band(trajectories: Sequence[Trajectory], share: float = 0.995) -> float:
    """Hz below which ``share`` of the velocities' energy lies, the widest joint of the widest recording.

    From measured velocities where there are some; otherwise from the angles' spectra. Above it only what stands out of
    the noise counts, whatever its colour. Beyond two octaves without motion, what is less than `_SHAKING` of the
    energy is none either: a servo that trembles. Joints that stand or creep beside others that move, in the same
    recording or another, do not count.
    """
    spectra = [spectrum for trajectory in trajectories if (spectrum := _velocity_spectra(trajectory)) is not None]
    if not spectra:
        return 0.0
    squares = np.array([energy.sum(axis=1) for _, energy in spectra])
    telling = squares > np.maximum(_CREEPS * squares.max(axis=0), _STANDS * squares.max())
    reached = (
        float(frequency[_reach(own, share)])
        for (frequency, energy), joints in zip(spectra, telling, strict=True)
        for own in energy[joints]
    )
    return max(reached, default=0.0)


def _velocity_spectra(trajectory: Trajectory) -> tuple[Array, Array] | None:
    """Frequencies (bins,) Hz, and what of each joint's mean square velocity (joints, bins) stands out of noise there;
    None for a recording without a gapless piece."""
    piece = next(trajectory.segments(longest=100_000, overlap=0), None)
    if piece is None:
        return None
    measured = trajectory.q if trajectory.dq is None else trajectory.dq
    channel = np.ascontiguousarray(resample(trajectory.t[piece], measured[piece], trajectory.rate).T)
    if trajectory.dq is None:
        channel = np.asarray(detrend(channel, axis=1))
    samples = channel.shape[1]
    frequency = np.asarray(np.fft.rfftfreq(samples, 1.0 / trajectory.rate), dtype=np.float64)
    power = np.abs(rfft(channel * (window := hann(samples, sym=False)), axis=1)) ** 2
    energy = np.where(power > _ABOVE_FLOOR * _floor(power), power, 0.0) / (samples * float(window @ window))
    if trajectory.dq is None:
        energy *= (2.0 * np.pi * frequency) ** 2
    slow = frequency <= _NO_MOTION
    return frequency[slow], energy[:, slow]


def _floor(power: Array) -> Array:
    """(joints, bins) of spectra, the median of the two octaves above each bin."""
    bins = power.shape[1]
    floor = np.empty_like(power)
    first = 0
    while first < bins:
        until = max(first + 1, int(1.2 * first))
        start = min(first, max(bins - _FLOOR_BINS, bins // 2))
        floor[:, first:until] = np.median(power[:, start : max(4 * first, start + _FLOOR_BINS)], axis=1, keepdims=True)
        first = until
    return floor


def _reach(energy: Array, share: float) -> int:
    """The bin below which a motion lies, of what of its spectrum's energy (bins,) stands out of noise."""
    below = np.cumsum(energy) / energy.sum()
    most = int(np.searchsorted(below, 1.0 - _SHAKING))
    octaves = below[np.minimum(4 * np.arange(len(below)), len(below) - 1)] - below
    return most + int(np.argmax(octaves[most:] <= 1.0 - share))
