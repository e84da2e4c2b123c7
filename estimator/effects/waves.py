"""A sine of an angle, linear in its quadratures: a·sin(x + φ) = (a·cos φ)·sin x + (a·sin φ)·cos x."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.effects.signals import Scales

Array = NDArray[np.float64]

MOST_ORDERS = 96
"""More are not tried; the highest are then left out."""
_EVENLY = 1e-9
"""Of the distance of orders, by which those may differ that are evenly spaced."""
_LEAST_REACH = 1e-3
"""rad; in less, no order is told from another."""


def orders(scales: Scales, joint: int) -> Array:
    """Orders a turn to try at a joint: as close as its range can tell apart, up to where the band ends."""
    reach = float(scales.q_high[joint] - scales.q_low[joint])
    if reach < _LEAST_REACH:
        return np.ones(1)
    step = max(math.pi / reach, 0.5)
    highest = 2.0 * math.pi * scales.band / max(float(scales.dq[joint]), 1e-6)
    count = int(min(max((highest - 1.0) / step, 0.0) + 1.0, MOST_ORDERS))
    return np.asarray(1.0 + step * np.arange(count))


def quadratures(angle: Array) -> Array:
    """(samples, 2): sine and cosine."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=1)


def each_quadratures(orders: Sequence[float], angle: Array) -> Iterator[Array]:
    """`quadratures` of the angle times each order. Of orders as far from each other, each is the one before turned on:
    a product instead of two transcendental functions a sample."""
    apart = np.diff(orders)
    if len(apart) < 2 or np.ptp(apart) > _EVENLY * abs(apart[0]):
        yield from (quadratures(order * angle) for order in orders)
        return
    turn, wave = np.exp(1j * apart[0] * angle), np.exp(1j * orders[0] * angle)
    for _ in orders:
        yield np.stack([wave.imag, wave.real], axis=1)
        wave *= turn


def amplitude_and_phase(coefficients: Array) -> tuple[float, float]:
    """Of the two coefficients; the phase is in (−π, π] rad."""
    sine, cosine = map(float, coefficients)
    return math.hypot(sine, cosine), math.atan2(cosine, sine)


def coefficients_of(amplitude: float, phase: float) -> Array:
    """The inverse."""
    return np.array([amplitude * math.cos(phase), amplitude * math.sin(phase)])
