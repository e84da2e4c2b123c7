"""Families of motions that are linear in what is designed: q = B(t)·X, and its derivatives."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config.motion.curves import REST_TO_REST

Array = NDArray[np.float64]


@dataclass(frozen=True)
class MotionBasis:
    """Columns over time: ``q, dq, ddq`` (samples, m). A motion is coefficients X (m, n), rad or m.

    ``centre`` (m,) are the coefficients of standing still at 1: X = centre ⊗ pose holds a pose.
    """

    t: Array
    q: Array
    dq: Array
    ddq: Array
    centre: Array

    def motion(self, coefficients: Array) -> tuple[Array, Array, Array]:
        """(q, dq, ddq), (samples, n) each."""
        return self.q @ coefficients, self.dq @ coefficients, self.ddq @ coefficients

    def towards_centre(self, coefficients: Array, share: float) -> Array:
        """The same motion with all its amplitudes times ``share``, about its own centre."""
        still = np.outer(self.centre, self.pose(coefficients))
        return np.asarray(still + share * (coefficients - still))

    def pose(self, coefficients: Array) -> Array:
        """(n,) the pose that the motion is about."""
        return np.asarray(self.centre @ coefficients / (self.centre @ self.centre))


def fourier_basis(base_hz: float, harmonics: int, samples: int) -> MotionBasis:
    """One period of centre, sines, cosines: the rows of X in this order (Swevers et al. 1997)."""
    t = np.arange(samples) / (samples * base_hz)
    w = 2.0 * np.pi * base_hz * np.arange(1, harmonics + 1)
    s, c = np.sin(np.outer(t, w)), np.cos(np.outer(t, w))
    one, none = np.ones((samples, 1)), np.zeros((samples, 1))
    centre = np.zeros(2 * harmonics + 1)
    centre[0] = 1.0
    return MotionBasis(
        t,
        np.hstack([one, s, c]),
        np.hstack([none, w * c, -w * s]),
        np.hstack([none, -(w**2) * s, -(w**2) * c]),
        centre,
    )


def polynomial_basis(durations: Sequence[float], order: int, samples: int) -> MotionBasis:
    """From rest to rest between way points, the rows of X, by polynomials of 5th or 7th order; ``durations`` in s."""
    starts = np.concatenate([[0.0], np.cumsum(durations)])
    t = np.linspace(0.0, starts[-1], samples)
    k = np.clip(np.searchsorted(starts, t, side="right") - 1, 0, len(durations) - 1)
    duration = np.asarray(durations, dtype=float)[k]
    u = np.clip((t - starts[k]) / duration, 0.0, 1.0)
    shape = REST_TO_REST[order]
    columns = []
    for derivative in range(3):
        curve = shape.deriv(derivative) if derivative else shape
        rise = curve(u) / duration**derivative
        block = np.zeros((samples, len(starts)))
        block[np.arange(samples), k] = (1.0 if derivative == 0 else 0.0) - rise
        block[np.arange(samples), k + 1] = rise
        columns.append(block)
    return MotionBasis(t, columns[0], columns[1], columns[2], np.ones(len(starts)))
