"""What the steps of an encoder put alike into every playing of one motion.

Where playings repeat to less than a step, rounding errs alike in all of them: it is no noise that differs between them,
and no fault of the model either. Of two roundings, d rms apart, the errors correlate by
(6/π²)·Σ exp(−½(2πkd/step)²)/k² (Widrow and Kollár, Quantization Noise, 2008).
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.channel_noise import ChannelNoise
from estimator.column_noise import column_noise
from estimator.rows import Layout
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_LOOKED_AT = 20_000
"""Samples of a recording in which steps are looked for."""
_ON_STEPS = 1e-3
"""Of a step: rms by which angles on steps miss whole ones."""
_MOST_STEPS = 1e4
"""Between neighbouring samples; beyond, rounding of numbers looks like steps."""
_IN_BAND = 2.0
"""Where a joint is slow, steps follow each other so slowly that more of their errors is in the band of the estimate
than of white noise; so much more is allowed for."""
_TERMS = 8
_ALIKE = 0.01
"""Correlation below which steps are noise like any other."""


def encoder_steps(trajectories: Sequence[Trajectory]) -> Array:
    """(n,) rad (m): the step of each joint's angles; zero where they go by none."""
    return np.asarray(np.min([_steps(t.q[:_LOOKED_AT]) for t in trajectories], axis=0))


def step_errors_alike(
    layout: Layout, trajectories: Sequence[Trajectory], band: float, apart: Array
) -> list[Array] | None:
    """For each joint (LAGS, p, p) of the rows' columns, as `column_noise`: the part of the steps' errors that playings
    have in common whose angles are ``apart`` (n,) rms. None where there is no such part."""
    steps = encoder_steps(trajectories)
    correlation = _correlation(np.divide(apart, steps, out=np.full_like(steps, np.inf), where=steps > 0.0))
    if not np.any(correlation > _ALIKE):
        return None
    # Rounding errors are evenly spread over a step; as a one-sided density, white but for the allowance.
    rate = trajectories[0].rate
    density = _IN_BAND * correlation * steps**2 / 12.0 * 2.0 / rate
    frequency = np.array([0.0, rate / 2.0])
    silent = None if trajectories[0].dq is None else np.zeros((2, len(steps)))
    return column_noise(layout, trajectories, band, ChannelNoise(frequency, np.tile(density, (2, 1)), silent))


def _steps(q: Array) -> Array:
    result = np.zeros(q.shape[1])
    for joint, angles in enumerate(q.T):
        moved = np.abs(np.diff(angles[np.isfinite(angles)]))
        moved = moved[moved > 1e-12 * max(float(np.nanmax(np.abs(angles), initial=0.0)), 1.0)]
        if not len(moved) or moved.max() > _MOST_STEPS * moved.min():
            continue
        step = float(moved.min())
        # The mean of many steps is surer than the smallest, which rounding of numbers has a share in.
        step = float(moved.sum() / np.round(moved / step).sum())
        if np.sqrt(np.mean((moved / step - np.round(moved / step)) ** 2)) < _ON_STEPS:
            result[joint] = step
    return result


def _correlation(apart: Array) -> Array:
    """Of rounding errors ``apart`` steps (rms) from each other."""
    order = np.arange(1, _TERMS + 1)[:, None]
    with np.errstate(over="ignore"):
        series = np.exp(-0.5 * (2.0 * np.pi * order * apart) ** 2) / order**2
    return np.asarray(series.sum(axis=0) / (1.0 / order**2).sum())
