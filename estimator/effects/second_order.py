"""The answer of a mass on a spring and a damper to a recorded force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

Array = NDArray[np.float64]

EDGE = 2
"""Samples at the start whose second differences are one-sided."""


def second_order_lag(x: Array, period: float, relaxation: float, square: float) -> Array:
    """x (samples, …) through 1/(1 + relaxation·s + square·s²), whose factors are in s and s².

    What it adds to x is the lag of −(relaxation·x' + square·x''), and that is what is filtered, exactly for signals
    that run straight from sample to sample and from a steady start: a motion recorded from its middle on rings less.
    """
    slope = np.gradient(x, period, axis=0)
    pull = -(relaxation * slope + square * np.gradient(slope, period, axis=0))
    system = (np.ones(1), np.array([square, relaxation, 1.0]))
    numerator, denominator, _ = cont2discrete(system, period, method="foh")
    b = np.ravel(numerator)
    start = np.multiply.outer(lfilter_zi(b, denominator), pull[EDGE])
    pull[:EDGE] = pull[EDGE]
    return np.asarray(x + lfilter(b, denominator, pull, axis=0, zi=start)[0])


def resonated(x: Array, period: float, frequency: float, ratio: float) -> Array:
    """The same for a resonance at ``frequency`` Hz of this damping ratio."""
    w = 2.0 * math.pi * frequency
    return second_order_lag(x, period, 2.0 * ratio / w, 1.0 / w**2)
