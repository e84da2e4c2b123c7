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

    Between samples x runs nearly as a cubic does, with the mean of the curvatures at both. A recording that begins in
    the middle of a motion does not make it ring: the parabola with which x begins has the lag's steady answer, and only
    the rest of x is filtered from rest.
    """
    if relaxation == 0.0 and square == 0.0:
        return np.array(x)
    t = period * np.arange(len(x)).reshape(-1, *[1] * (x.ndim - 1))
    count = min(START, len(x))
    powers = np.vander(period * np.arange(count), 3, increasing=True)
    at, slope, half = np.linalg.lstsq(powers, x[:count].reshape(count, -1), rcond=None)[0].reshape(3, *x.shape[1:])
    parabola = at + slope * t + half * t**2
    steady = parabola - relaxation * (slope + 2.0 * half * t) + (relaxation**2 - square) * 2.0 * half
    rest = x - parabola
    # Of each interval, to its end: the mean of what its ends say.
    bent = np.zeros_like(rest)
    if len(rest) > 2:
        curvature = np.diff(rest, 2, axis=0) / period**2
        bent[2:-1] = 0.5 * (curvature[1:] + curvature[:-1])
        bent[1], bent[-1] = curvature[0], curvature[-1]
    straight, curved, denominator = _sampled(period, relaxation, square)
    return np.asarray(
        steady + lfilter(straight, denominator, rest, axis=0) + lfilter(curved, denominator, bent, axis=0)
    )


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


def _sampled(period: float, relaxation: float, square: float) -> tuple[Array, Array, Array]:
    """The lag as a filter of samples, and of the curvature on the way to each: two numerators and the denominator in
    powers of 1/z.

    The first is a first-order hold, which `scipy.signal.cont2discrete` gives some ten times more slowly, by way of
    general transfer functions.
    """
    # States, then the input and its derivatives (Franklin, Powell, Workman 1998, 6.3.3).
    size = 2 if square else 1
    system = np.zeros((size + 3, size + 3))
    if square:
        system[0, :3] = -relaxation / square, -1.0 / square, 1.0 / square
        system[1, 0] = 1.0
    else:
        system[0, :2] = -1.0 / relaxation, 1.0 / relaxation
    system[size, size + 1] = system[size + 1, size + 2] = 1.0
    moved = expm(system * period)[:size]
    states, now = moved[:, :size], moved[:, size]
    gained = moved[:, size + 1] / period
    bowed = moved[:, size + 2] - 0.5 * period * moved[:, size + 1]
    if not square:
        pole = states[0, 0]
        return np.array([gained[0], now[0] - gained[0]]), bowed, np.array([1.0, -pole])
    given, through = now - gained + states @ gained, gained[1]
    trace, determinant = states[0, 0] + states[1, 1], states[0, 0] * states[1, 1] - states[0, 1] * states[1, 0]
    once, twice = given[1] - trace * through, states[1] @ given - trace * given[1] + determinant * through
    curved = np.array([bowed[1], states[1] @ bowed - trace * bowed[1]])
    return np.array([through, once, twice]), curved, np.array([1.0, -trace, determinant])


def resonated(x: Array, period: float, frequency: float, ratio: float) -> Array:
    """The same for a resonance at ``frequency`` Hz of this damping ratio."""
    w = 2.0 * math.pi * frequency
    return second_order_lag(x, period, 2.0 * ratio / w, 1.0 / w**2)
