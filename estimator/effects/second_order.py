"""The answer of a mass on a spring and a damper to a recorded force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter

Array = NDArray[np.float64]

START = 8
"""Samples that say how a signal begins."""


def second_order_lag(x: Array, period: float, relaxation: float, square: float) -> Array:
    """x (samples, …) through 1/(1 + relaxation·s + square·s²), whose factors are in s and s².

    Exact for signals that run straight from sample to sample. A recording that begins in the middle of a motion does
    not make it ring: the parabola with which x begins has the lag's steady answer, and only the rest of x is filtered
    from rest.
    """
    if relaxation == 0.0 and square == 0.0:
        return np.array(x)
    t = period * np.arange(len(x)).reshape(-1, *[1] * (x.ndim - 1))
    count = min(START, len(x))
    powers = np.vander(period * np.arange(count), 3, increasing=True)
    at, slope, half = np.linalg.lstsq(powers, x[:count].reshape(count, -1), rcond=None)[0].reshape(3, *x.shape[1:])
    parabola = at + slope * t + half * t**2
    # The chords between samples lie half·period²/6 above a parabola, on the mean.
    steady = (
        parabola - relaxation * (slope + 2.0 * half * t) + ((relaxation**2 - square) * 2.0 + period**2 / 6.0) * half
    )
    system = (np.ones(1), np.array([square, relaxation, 1.0]))
    numerator, denominator, _ = cont2discrete(system, period, method="foh")
    return np.asarray(steady + lfilter(np.ravel(numerator), denominator, x - parabola, axis=0))


def resonated(x: Array, period: float, frequency: float, ratio: float) -> Array:
    """The same for a resonance at ``frequency`` Hz of this damping ratio."""
    w = 2.0 * math.pi * frequency
    return second_order_lag(x, period, 2.0 * ratio / w, 1.0 / w**2)
