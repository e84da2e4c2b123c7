"""Noise spectra of angles and velocities by redundant sensing (thesis, Eq. 5.66 and 5.67), and how to join the two.

An angle and a velocity of one motion are two sensors with the known transfer H = jω between them. What they share is
the motion; what they do not share is noise:

    S_nq = S_q − S_qv / H*            (5.67, the angle's)
    S_nv = S_v − S_qv · H             (5.66, the velocity's)

Where the motion itself is strong the first is a small difference of large spectra; there the angle's noise is continued
from the nearest frequency that tells it. The velocity's follows without that difference from S_nv = S_d − |H|²·S_nq,
S_d the spectrum of what velocity and differentiated angle disagree by.

Joined, the acceleration's noise is least when each frequency takes angle and velocity in the inverse ratio of |H|²·S_nq
to S_nv: the angle below a crossover, the velocity above.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray
from scipy.signal import detrend
from scipy.signal.windows import nuttall

from estimator.convolution import convolve
from estimator.filtering import FLAT_TO_BAND, FilterPlan, plan_filter, resample
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_WINDOW = 2.0
"""s; the spectra tell from half a Hz."""
_MOST_WINDOWS = 60
"""Windows looked at, spread over all recordings: noise to a tenth, whatever the length of the data."""
_OCTAVE_SHARES = 6
"""Frequencies are averaged over sixths of an octave."""
_FLAT_TO_RATE = 0.3
"""Of the sampling rate: up to there spectra are told."""
_INDEPENDENT = 2.0
"""Neighbouring frequencies of a tapered window that count as one."""
_SAME_RATE = 0.05
_LEAST_SHARE = 1e-3
"""Of the disagreement that is the velocity's at least: no sensor is without noise."""
_SIGNIFICANT = 4.0
"""Standard errors by which the angle's noise must stand out of the motion to be believed."""
_CROSSOVERS = np.concatenate([[0.0], 2.0 * np.pi * np.geomspace(0.5, 500.0, 61), [np.inf]])


@dataclass(frozen=True)
class ChannelNoise:
    """One-sided power densities of the measured channels' noise, of every joint."""

    frequency: Array
    """(m,) Hz, rising to half the sampling rate."""
    angle: Array
    """(m, n) rad²/Hz"""
    velocity: Array | None
    """(m, n) (rad/s)²/Hz; None where no velocity was measured."""

    def crossover(self, band: float) -> Array:
        """(n,) rad/s below which the angle is to be trusted and above which the velocity, so that noise of the
        acceleration below ``band`` Hz is least; infinite: the angle alone, zero: the velocity alone."""
        if self.velocity is None:
            return np.full(self.angle.shape[1], np.inf)
        inside = self.frequency <= max(band, float(self.frequency[1]))
        omega = 2.0 * np.pi * self.frequency[inside][:, None, None]
        with np.errstate(invalid="ignore"):
            share = np.where(np.isinf(_CROSSOVERS), 0.0, omega**2 / (omega**2 + _CROSSOVERS**2))
        angle, velocity = self.angle[inside][:, :, None], self.velocity[inside][:, :, None]
        power = omega**2 * ((1.0 - share) ** 2 * omega**2 * angle + share**2 * velocity)
        total = np.trapezoid(power, self.frequency[inside], axis=0)
        return np.asarray(_CROSSOVERS[np.argmin(total, axis=1)])


def channel_noise(trajectories: Sequence[Trajectory]) -> ChannelNoise | None:
    """Noise of angles and velocities, from windows of two seconds; None for recordings without one such window.

    What a velocity that is late or of a wrong scale disagrees by counts as its noise: the angle is trusted the more.

    Recordings of one set of sensors, at one sampling rate (of others, those at the first one's are taken). Where
    velocities were not measured, the angle's noise is what its spectrum settles at above the motion.
    """
    rate = trajectories[0].rate
    alike = [t for t in trajectories if abs(t.rate / rate - 1.0) < _SAME_RATE]
    plan = plan_filter(rate, _FLAT_TO_RATE / FLAT_TO_BAND * rate)
    length = int(_WINDOW * rate)
    windows = [(t, piece) for t in alike for piece in t.segments(length + 2 * plan.edge, 0)]
    windows = [(t, piece) for t, piece in windows if len(piece) == length + 2 * plan.edge]
    if not windows:
        return None
    redundant = all(t.dq is not None for t in alike)
    used = windows[:: max(1, len(windows) // _MOST_WINDOWS)]
    spectra = np.mean([_window_spectra(plan, t, piece, redundant) for t, piece in used], axis=0)
    frequency = np.arange(spectra.shape[1]) * (rate / length)
    bands = _bands(frequency, _FLAT_TO_RATE * rate)
    centre = np.array([frequency[b].mean() for b in bands])
    angles, common, disagreement = (np.array([x[b].mean(axis=0) for b in bands]) for x in spectra)
    looks = np.array([2.0 * len(used) * (b.stop - b.start) / _INDEPENDENT for b in bands])
    return _separated(centre, angles, common, disagreement if redundant else None, looks)


def _window_spectra(plan: FilterPlan, trajectory: Trajectory, piece: NDArray[np.intp], redundant: bool) -> Array:
    """(3, m, n) one-sided densities of one window: the angle's, its part common with the velocity (seen as an angle),
    and of the disagreement between velocity and differentiated angle."""
    t = trajectory.t[piece]
    q = _fitted(resample(t, trajectory.q[piece], plan.rate), len(piece))
    angle, slope = convolve(q, plan.smooth), convolve(q, plan.slope)
    taper = nuttall(len(angle))[:, None]
    scale = 2.0 / (plan.rate * float(np.sum(taper**2)))
    frequency = np.fft.rfftfreq(len(angle), 1.0 / plan.rate)[:, None]
    seen = np.fft.rfft(detrend(angle, axis=0) * taper, axis=0)
    own = scale * np.abs(seen) ** 2
    if not redundant or trajectory.dq is None:
        return np.stack([own, np.zeros_like(own), np.zeros_like(own)])
    # The disagreement is taken in time, where no taper stands between the angle and its derivative.
    dq = _fitted(resample(t, trajectory.dq[piece], plan.rate), len(piece))
    off = np.fft.rfft((convolve(dq, plan.smooth) - slope) * taper, axis=0)
    omega = 2j * np.pi * np.maximum(frequency, frequency[1])
    # With V = H·Q + D: S_qv/H* = S_q + S_qd/H*, so that the angle's noise is −S_qd/H*.
    common = own + scale * np.real(seen * np.conj(off) / np.conj(omega))
    return np.stack([own, common, scale * np.abs(off) ** 2])


def _fitted(channel: Array, length: int) -> Array:
    """Jitter makes a window some samples shorter or longer: its end is held, or cut."""
    return np.pad(channel[:length], ((0, max(0, length - len(channel))), (0, 0)), mode="edge")


def _separated(
    frequency: Array, angles: Array, common: Array, disagreement: Array | None, looks: Array
) -> ChannelNoise:
    """The spectra told apart; what the motion hides is continued from above."""
    if disagreement is None:
        floor = np.median(angles[frequency > 0.5 * frequency[-1]], axis=0)
        return ChannelNoise(frequency, np.repeat(floor[None], len(frequency), axis=0), None)
    noise = angles - common
    doubt = np.sqrt((angles + np.abs(common)) * np.abs(angles) / looks[:, None])
    believed = noise > np.maximum(_SIGNIFICANT * doubt, _SIGNIFICANT * np.finfo(float).eps * angles)
    omega = 2.0 * np.pi * frequency[:, None]
    # Nothing can be more than what the two disagree by.
    most = disagreement / omega**2
    angle = np.minimum(noise, most)
    for joint in range(angle.shape[1]):
        # White noise of the angle cannot be more than the least that the two disagree by.
        last, hidden = float(most[:, joint].min()), False
        for k in reversed(range(len(frequency))):
            if believed[k, joint] and not hidden:
                last = float(angle[k, joint])
            else:
                hidden = hidden or bool(believed[k:, joint].any())
                angle[k, joint] = min(last, float(most[k, joint]))
    velocity = np.maximum(disagreement - omega**2 * angle, _LEAST_SHARE * disagreement)
    return ChannelNoise(frequency, angle, velocity)


def _bands(frequency: Array, highest: float) -> list[slice]:
    """Neighbouring frequencies, a sixth of an octave together, without the lowest (the straight line taken away)."""
    edges: list[int] = [2]
    while frequency[edges[-1]] < highest:
        following = int(np.searchsorted(frequency, frequency[edges[-1]] * 2.0 ** (1.0 / _OCTAVE_SHARES)))
        edges.append(max(following, edges[-1] + 1))
    return [slice(a, b) for a, b in pairwise(edges)]
