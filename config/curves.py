"""Curves between points, with their exact derivatives: what motions are made of."""

from __future__ import annotations

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray

Array = NDArray[np.float64]

REST_TO_REST = {
    # s(x) on [0, 1] with s(0) = 0, s(1) = 1 and all derivatives up to the second (third) zero at both ends.
    5: Polynomial([0, 0, 0, 10, -15, 6]),
    7: Polynomial([0, 0, 0, 0, 35, -84, 70, -20]),
}


def rest_to_rest(q0: Array, q1: Array, duration_s: float, order: int, t: Array) -> tuple[Array, Array, Array]:
    """Straight line in joint space from rest to rest by the 5th- or 7th-order polynomial (5th: minimum jerk).

    ``q0``, ``q1``: joints [rad]; ``t``: samples [s] within 0 to ``duration_s``. Returns q, dq, ddq, each samples ×
    joints.
    """
    s = REST_TO_REST[order]
    x = t / duration_s
    way = q1 - q0
    return (
        q0 + np.outer(s(x), way),
        np.outer(s.deriv()(x) / duration_s, way),
        np.outer(s.deriv(2)(x) / duration_s**2, way),
    )


def fourier(q0: Array, sine: Array, cosine: Array, base_hz: float, t: Array) -> tuple[Array, Array, Array]:
    """Periodic motion q0 + Σ_k sine_k·sin(kωt) + cosine_k·(cos(kωt) − 1), ω = 2π·base_hz (starts at q0).

    ``sine``, ``cosine``: harmonics × joints [rad]; ``t``: samples [s]. Returns q, dq, ddq, each samples × joints.
    """
    k = 2 * np.pi * base_hz * np.arange(1, len(sine) + 1)
    phase = np.outer(t, k)
    s, c = np.sin(phase), np.cos(phase)
    q = q0 + s @ sine + (c - 1) @ cosine
    dq = (c * k) @ sine - (s * k) @ cosine
    ddq = -(s * k**2) @ sine - (c * k**2) @ cosine
    return q, dq, ddq


def peaks_of_rest_to_rest(order: int) -> tuple[float, float]:
    """Peak speed and acceleration of the unit rest-to-rest curve over unit time (5th order: 1.875, 5.7735)."""
    x = np.linspace(0, 1, 20001)
    s = REST_TO_REST[order]
    return float(np.abs(s.deriv()(x)).max()), float(np.abs(s.deriv(2)(x)).max())
