"""A sine of an angle, linear in its quadratures: a·sin(x + φ) = (a·cos φ)·sin x + (a·sin φ)·cos x."""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.effects.signals import Scales

Array = NDArray[np.float64]

MOST_ORDERS = 96
"""More are not tried at first; the highest are then left out."""
_MOST_FINE = 400
"""Likewise of those above."""
_SLOWLY = 8.0
"""Times the orders up to the end of the band at a motion's mean speed, up to which its slow parts tell some."""
_EVENLY = 1e-9
"""Of the distance of orders, by which those may differ that are evenly spaced."""
_HALF, _FADED = math.pi, 1.2 * math.pi
"""rad a sample, from which a wave fades, and at which nothing is left of it."""
_LEAST_REACH = 1e-3
"""rad; in less, no order is told from another."""


def orders(scales: Scales, joint: int) -> Array:
    """Orders a turn to try at a joint: as close as its range can tell apart, up to where the band ends."""
    step, highest = _spacing(scales, joint), _highest(scales, joint)
    if not math.isfinite(step):
        return np.ones(1)
    count = int(min(max((highest - 1.0) / step, 0.0) + 1.0, MOST_ORDERS))
    return np.asarray(1.0 + step * np.arange(count))


def fine_orders(scales: Scales, joint: int) -> Array:
    """Those above, which only slow parts of a motion have within the band, or of which there are too many to try all
    of them first: a gear's, or a motor's behind one."""
    step = _spacing(scales, joint)
    if not math.isfinite(step):
        return np.zeros(0)
    lowest = float(orders(scales, joint)[-1]) + step
    count = int(min(max((_SLOWLY * _highest(scales, joint) - lowest) / step + 1.0, 0.0), _MOST_FINE))
    return np.asarray(lowest + step * np.arange(count))


def _spacing(scales: Scales, joint: int) -> float:
    """Of orders that a joint's range tells apart; without end where it tells none."""
    reach = float(scales.q_high[joint] - scales.q_low[joint])
    return math.inf if reach < _LEAST_REACH else max(math.pi / reach, 0.5)


def _highest(scales: Scales, joint: int) -> float:
    """Order that passes at the end of the band at the joint's mean speed."""
    return 2.0 * math.pi * scales.band / max(float(scales.dq[joint]), 1e-6)


def quadratures(angle: Array) -> Array:
    """(samples, 2): sine and cosine."""
    return np.stack([np.sin(angle), np.cos(angle)], axis=1)


def each_quadratures(orders: Sequence[float], angle: Array, turned: Array) -> Iterator[Array]:
    """`quadratures` of the angle times each order, where samples tell them; ``turned`` (samples,) rad of the angle from
    one sample to the next. Of orders as far from each other, each is the one before turned on: a product instead of two
    transcendental functions a sample."""
    for order, waves in zip(orders, _each_wave(orders, angle), strict=True):
        advance = np.abs(order * turned)
        # What is passed faster than samples tell would come back as another, slow wave.
        yield waves * _told(advance)[:, None] if advance.max() > _HALF else waves


def _each_wave(orders: Sequence[float], angle: Array) -> Iterator[Array]:
    apart = np.diff(orders)
    if len(apart) < 2 or np.ptp(apart) > _EVENLY * abs(apart[0]):
        yield from (quadratures(order * angle) for order in orders)
        return
    turn, wave = np.exp(1j * apart[0] * angle), np.exp(1j * orders[0] * angle)
    for _ in orders:
        yield np.stack([wave.imag, wave.real], axis=1)
        wave *= turn


def _told(advance: Array) -> Array:
    """One of a wave that goes on by less than half a period from one sample to the next, and nothing of one by far
    more."""
    return np.asarray(0.5 + 0.5 * np.cos(np.pi * np.clip((advance - _HALF) / (_FADED - _HALF), 0.0, 1.0)))


def amplitude_and_phase(coefficients: Array) -> tuple[float, float]:
    """Of the two coefficients; the phase is in (−π, π] rad."""
    sine, cosine = map(float, coefficients)
    return math.hypot(sine, cosine), math.atan2(cosine, sine)


def coefficients_of(amplitude: float, phase: float) -> Array:
    """The inverse."""
    return np.array([amplitude * math.cos(phase), amplitude * math.sin(phase)])
