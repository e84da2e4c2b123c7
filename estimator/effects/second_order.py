"""The answer of a mass on a spring and a damper to a recorded force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.signal import lfilter

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
    numerator, denominator = _sampled(period, relaxation, square)
    return np.asarray(steady + lfilter(numerator, denominator, x - parabola, axis=0))


def _sampled(period: float, relaxation: float, square: float) -> tuple[Array, Array]:
    """The lag as a filter of samples (first-order hold): numerator and denominator in powers of 1/z.

    `scipy.signal.cont2discrete` gives the same some ten times more slowly, by way of general transfer functions.
    """
    # States, then the input and what it gains in a period (Franklin, Powell, Workman 1998, 6.3.3).
    if square == 0.0:
        system = np.array([[-1.0 / relaxation, 1.0 / relaxation, 0.0], [0.0, 0.0, 1.0 / period], [0.0, 0.0, 0.0]])
        moved = expm(system * period)
        pole, now, gained = moved[0]
        return np.array([gained, now - gained]), np.array([1.0, -pole])
    system = np.zeros((4, 4))
    system[0, :3] = -relaxation / square, -1.0 / square, 1.0 / square
    system[1, 0], system[2, 3] = 1.0, 1.0 / period
    moved = expm(system * period)
    states, now, gained = moved[:2, :2], moved[:2, 2], moved[:2, 3]
    given, through = now - gained + states @ gained, gained[1]
    trace, determinant = states[0, 0] + states[1, 1], states[0, 0] * states[1, 1] - states[0, 1] * states[1, 0]
    once, twice = given[1] - trace * through, states[1] @ given - trace * given[1] + determinant * through
    return np.array([through, once, twice]), np.array([1.0, -trace, determinant])


def resonated(x: Array, period: float, frequency: float, ratio: float) -> Array:
    """The same for a resonance at ``frequency`` Hz of this damping ratio."""
    w = 2.0 * math.pi * frequency
    return second_order_lag(x, period, 2.0 * ratio / w, 1.0 / w**2)
