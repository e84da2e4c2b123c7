"""The answer of a mass on a spring and a damper to a recorded force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import expm
from scipy.linalg.lapack import dtbtrs
from scipy.signal import lfilter

Array = NDArray[np.float64]

_SLOW = 0.05
"""rad of a swing from sample to sample, below which a difference of two large numbers would tell the method."""
_STABLE = 0.8
"""Of the longest step that Newmark's method takes without growing, squared."""
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


def swing(force: Array, period: float, inertia: Array, damping: Array, stiffness: Array) -> Array:
    """(samples,) x of inertia·x'' + damping·x' + stiffness·x = force, all (samples,) along a motion.

    Newmark's method (1959) with γ = ½, and β such that a free swing has its frequency whatever the period: 1/12 where
    it is slow, where the method is of fourth order; ¼ where samples do not show it, anywhere along the motion. x begins
    as `second_order_lag` does.
    """
    turn = period * math.sqrt(float(np.mean(stiffness)) / float(np.mean(inertia)))
    fastest = period * math.sqrt(float(np.max(stiffness / inertia)))
    beta = 1.0 / 12.0 if turn < _SLOW else 0.25 if turn > math.pi else 0.5 / (1.0 - math.cos(turn)) - turn**-2
    beta = max(beta, 0.25 - _STABLE / fastest**2)
    spread = np.array([beta, 1.0 - 2.0 * beta, beta])
    # The equation at sample n in the unknowns n − 1, n, n + 1, as the rows of a triangular system.
    centre, drag, spring = inertia[1:-1], 0.5 * period * damping[1:-1], period**2 * stiffness
    bands = np.ones((3, len(force)), order="F")
    bands[0, 2:] = centre + drag + spread[0] * spring[2:]
    bands[1, 1:-1] = -2.0 * centre + spread[1] * spring[1:-1]
    bands[2, :-2] = centre - drag + spread[2] * spring[:-2]
    bands[1, 0] = 0.0
    right = np.empty(len(force))
    right[:2] = _begun(force, period, inertia, damping, stiffness)
    right[2:] = period**2 * np.convolve(force, spread, mode="valid")
    result, singular = dtbtrs(bands, right, uplo="L")
    assert singular == 0
    return np.asarray(result)


def _begun(force: Array, period: float, inertia: Array, damping: Array, stiffness: Array) -> Array:
    """(2,) the first samples of the steady answer to the parabola that the force begins with."""
    count = min(START, len(force))
    powers = np.vander(period * np.arange(count), 3, increasing=True)
    at, slope, half = np.linalg.lstsq(powers, force[:count], rcond=None)[0]
    k, d, m = (float(np.mean(x[:count])) for x in (stiffness, damping, inertia))
    bent = half / k
    speed = (slope - 2.0 * d * bent) / k
    first = (at - d * speed - 2.0 * m * bent) / k
    t = np.array([0.0, period])
    return np.asarray(first + speed * t + bent * t**2)


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
