"""Errors that repeat although no law of the arm makes them: those of an encoder's counts.

Where a motion repeats to less than a count, so do its rounding errors, and the differences between playings do not
show them.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.signal import firwin

from estimator.repeats import RepeatGroup, aligned
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_WHOLE = 0.02
"""Of a count: how near to whole multiples all steps must be …"""
_MOST = 0.98
"""… but for a few of them."""
_FEWEST = 50
"""Steps between neighbouring angles that a count must be read from …"""
_FEW_COUNTS = 20.0
"""… each of fewer counts than this."""
_SMALLEST = 1e-9
"""rad; finer differences are rounding of the file's digits."""


def counts(trajectories: Sequence[Trajectory]) -> Array:
    """(n,) rad that one count of each joint's encoder is, 0 where the angles show no steps."""
    result = np.zeros(trajectories[0].q.shape[1])
    for joint in range(len(result)):
        angles = np.concatenate([trajectory.q[:, joint] for trajectory in trajectories])
        steps = np.diff(np.sort(angles[np.isfinite(angles)]))
        steps = steps[steps > _SMALLEST]
        if len(steps) < _FEWEST:
            continue
        count = float(steps.min())
        for _ in range(3):
            # The count is the mean of the steps, each divided by how many counts it has.
            multiples = np.maximum(np.round(steps / count), 1.0)
            few = multiples < _FEW_COUNTS
            if np.count_nonzero(few) < _FEWEST:
                break
            count = float(np.median(steps[few] / multiples[few]))
        share = steps[few] / count
        if np.count_nonzero(few) >= _FEWEST and np.mean(np.abs(share - np.round(share)) < _WHOLE) > _MOST:
            result[joint] = count
    return result


def repeated_share(count: Array, groups: Sequence[RepeatGroup]) -> Array:
    """(n,) of the variance of rounding errors, how much is the same in all playings: the first harmonic of the
    sawtooth under a Gaussian difference."""
    if not groups:
        return np.zeros_like(count)
    mismatch = np.min([group.mismatch for group in groups], axis=0)
    share = np.where(count > 0.0, mismatch / np.where(count > 0.0, count, 1.0), np.inf)
    return np.asarray(np.exp(-2.0 * np.pi**2 * share**2))


def rounding(q: Array, count: Array, random: np.random.Generator) -> Array:
    """(samples, n) one realisation of the rounding errors along a motion, rad."""
    offset = count * random.uniform(size=len(count))
    safe = np.where(count > 0.0, count, 1.0)
    moved = (q + offset) / safe
    return np.asarray(np.where(count > 0.0, (np.round(moved) - moved) * safe, 0.0))


_ABOVE = (1.5, 3.5)
"""Times the compared band: what repeats there is far above the motion, and jitter of the time stamps still small."""
_ALIGNED = 0.42
"""Of the rate, to which playings are laid on each other exactly."""
_PERIODS = 6.0
"""Of the lower edge, that the filter is long."""


def repeated_white(
    trajectories: Sequence[Trajectory], groups: Sequence[RepeatGroup], channels: Sequence[Array], band: float
) -> Array:
    """(n,) variance of a sample's error that is white and the same in all playings, by the spectrum above ``band`` Hz.

    ``channels`` (samples, n) of each trajectory. A servo that repeats to less than a count plays its rounding errors
    again too, as torque and speed; sampled more slowly than they change, they fold over the whole band.
    """
    rate = min(trajectory.rate for trajectory in trajectories)
    edges = _ABOVE[0] * band / rate, min(_ABOVE[1] * band / rate, _ALIGNED)
    taps = firwin(2 * int(_PERIODS / edges[0] / 2.0) + 1, edges, pass_zero=False, fs=1.0)
    taps = taps / np.linalg.norm(taps)
    n = trajectories[0].q.shape[1]
    times = [trajectory.t[0] + np.arange(trajectory.samples) / trajectory.rate for trajectory in trajectories]
    even = [
        np.array([np.interp(grid, t.t, column) for column in c.T]).T
        for grid, t, c in zip(times, trajectories, channels, strict=True)
    ]
    power, samples = np.zeros(n), 0
    for group in groups:
        _, stack = aligned(group, times, even)
        if stack.shape[1] <= 4 * len(taps) or not np.isfinite(stack).all():
            continue
        top = np.apply_along_axis(np.convolve, 1, stack, taps, mode="valid")
        count = len(top)
        noise = np.sum((top - top.mean(axis=0)) ** 2, axis=0) / (count - 1)
        power += np.sum(top.mean(axis=0) ** 2 - noise / count, axis=0)
        samples += top.shape[1]
    return np.maximum(power, 0.0) / max(samples, 1)
