"""Histories of finite length by frequency: the cosine transform, whose even continuation has no jump at the ends."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.fft import dct, idct
from scipy.ndimage import gaussian_filter1d

Array = NDArray[np.float64]
ROLL_OFF = 0.25
"""A low-pass falls from one to zero between its band and this much above it."""
NEIGHBOURS = 6.0
"""Lines over which a spectrum is averaged (the Gaussian's standard deviation): from few trials it is rough."""


def frequencies(samples: int, period: float) -> Array:
    """(samples,) Hz of the lines of `to_lines`."""
    return np.arange(samples) / (2.0 * samples * period)


def to_lines(history: Array) -> Array:
    """Orthonormal cosine transform along the first axis: white noise of variance v has lines of variance v."""
    return np.asarray(dct(history, axis=0, norm="ortho"))


def to_history(lines: Array) -> Array:
    """Back from `to_lines`."""
    return np.asarray(idct(lines, axis=0, norm="ortho"))


def low_pass(frequency: Array, band_hz: float) -> Array:
    """Gain of the zero-phase low-pass: 1 up to the band, 0 from `ROLL_OFF` above it, a cosine between."""
    share = np.clip((np.asarray(frequency) / band_hz - 1.0) / ROLL_OFF, 0.0, 1.0)
    return np.asarray(0.5 * (1.0 + np.cos(np.pi * share)))


def smoothed_power(power: Array) -> Array:
    """A spectrum averaged over neighbouring lines (first axis)."""
    return np.asarray(gaussian_filter1d(power, NEIGHBOURS, axis=0, mode="nearest"))
