"""The answer of a mass on a spring and a damper to a recorded force."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.signal import cont2discrete, lfilter, lfilter_zi

Array = NDArray[np.float64]


def second_order_lag(x: Array, period: float, relaxation: float, square: float) -> Array:
    """x (samples, …) through 1/(1 + relaxation·s + square·s²), whose factors are in s and s².

    Exact for signals that run straight from sample to sample; at rest under its first sample before it begins.
    """
    system = (np.ones(1), np.array([square, relaxation, 1.0]))
    numerator, denominator, _ = cont2discrete(system, period, method="foh")
    b = np.ravel(numerator)
    start = np.multiply.outer(lfilter_zi(b, denominator), x[0])
    return np.asarray(lfilter(b, denominator, x, axis=0, zi=start)[0])


def resonated(x: Array, period: float, frequency: float, ratio: float) -> Array:
    """The same for a resonance at ``frequency`` Hz of this damping ratio."""
    w = 2.0 * math.pi * frequency
    return second_order_lag(x, period, 2.0 * ratio / w, 1.0 / w**2)
