"""Motion as a spline: the unknown true motion of a stretch of recording in a few numbers, and how torques follow it.

Degree five on uniform knots, so that accelerations are smooth. Designs depend on a stretch's length alone and are kept.
"""

from __future__ import annotations

from dataclasses import dataclass
from functools import lru_cache
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy import sparse
from scipy.interpolate import BSpline
from scipy.sparse.linalg import spsolve

from estimator.filtering import FilterPlan, Motion, ThinnedMotion, root_raised_cosine

Array = NDArray[np.float64]
Sparse = Any
"""scipy.sparse has no types of its own."""

_DEGREE = 5
_KNOTS_TO_BAND = 4.0
"""Knots a second for each Hz of the rows' band: the spline holds motion up to twice the band."""


@dataclass(frozen=True)
class MotionSpline:
    """Designs (samples, K) of a stretch: its motion is design @ coefficients (K, n). Make it with `motion_spline`."""

    at: tuple[Sparse, Sparse]
    """Angle and velocity at every sample."""
    thin: tuple[Sparse, Sparse, Sparse]
    """Angle, velocity and acceleration where the regressor is evaluated."""
    grams: tuple[Sparse, Sparse]
    """(K, K) of `at`."""
    decimate: Sparse
    """(rows, thinned samples): the parallel filter from where the regressor is evaluated to the rows."""

    def fitted(self, q: Array, dq: Array | None, angle: Array, velocity: Array | None) -> Array:
        """(K, n) coefficients nearest the measured motion, with variances (n,) of its samples."""
        result = np.empty((self.at[0].shape[1], q.shape[1]))
        for joint in range(q.shape[1]):
            gram, right = self.grams[0] / angle[joint], self.at[0].T @ q[:, joint] / angle[joint]
            if dq is not None and velocity is not None:
                gram = gram + self.grams[1] / velocity[joint]
                right = right + self.at[1].T @ dq[:, joint] / velocity[joint]
            result[:, joint] = spsolve(gram.tocsc(), right)
        return result

    def motion(self, coefficients: Array) -> ThinnedMotion:
        """Of coefficients (K, n)."""
        return ThinnedMotion(Motion(*(x @ coefficients for x in self.thin)), self.at[1] @ coefficients)

    def torque_slope(self, slopes: Array, weight: Array) -> Sparse:
        """(rows, K·n): of one joint's decimated torque to all coefficients, coefficient after coefficient.

        ``slopes`` (3, thinned, n) of its torque to each joint's angle, velocity, acceleration; ``weight`` (thinned,).
        """
        n = slopes.shape[2]
        result = 0.0
        for joint in range(n):
            own = sum(sparse.diags(weight * slope[:, joint]) @ x for slope, x in zip(slopes, self.thin, strict=True))
            result = result + sparse.kron(self.decimate @ own, np.eye(n)[joint : joint + 1], format="csr")
        return result


def motion_spline(samples: int, plan: FilterPlan) -> MotionSpline:
    """Of a stretch of so many samples, for rows by this plan."""
    return _designs(samples, plan.rate, plan.stride, plan.decimation, _KNOTS_TO_BAND * plan.band)


@lru_cache(maxsize=4)
def _designs(samples: int, rate: float, stride: int, decimation: int, knot_rate: float) -> MotionSpline:
    # Knots end where the stretch ends: a spline that only the last sample touches would be as good as free.
    intervals = max(1, round((samples - 1) / rate * knot_rate))
    u = np.linspace(0.0, intervals, samples)
    knot_rate = intervals * rate / (samples - 1)
    knots = np.arange(-_DEGREE, intervals + _DEGREE + 1, dtype=float)
    orders = []
    difference: Sparse = sparse.identity(intervals + _DEGREE, format="csr")
    for order in range(3):
        own = knots[order : len(knots) - order]
        design = BSpline.design_matrix(u, own, _DEGREE - order) @ difference * knot_rate**order
        orders.append(sparse.csr_matrix(design))
        size = difference.shape[0]
        difference = sparse.diags([-1.0, 1.0], [0, 1], shape=(size - 1, size)) @ difference
    thin = tuple(x[::stride] for x in orders)
    value, slope = orders[0], orders[1]
    decimate = _decimating(thin[0].shape[0], decimation)
    return MotionSpline((value, slope), (thin[0], thin[1], thin[2]), (value.T @ value, slope.T @ slope), decimate)


def _decimating(samples: int, decimation: int) -> Sparse:
    """What `estimator.filtering.Decimator` does, as a matrix."""
    if decimation == 1:
        return sparse.identity(samples, format="csr")
    kernel = root_raised_cosine(decimation)
    outputs = -(-samples // decimation)
    place = np.arange(outputs)[:, None] * decimation + np.arange(len(kernel))[None, :] - len(kernel) // 2
    row = np.broadcast_to(np.arange(outputs)[:, None], place.shape)
    inside = (place >= 0) & (place < samples)
    values = np.broadcast_to(kernel, place.shape)[inside]
    return sparse.csr_matrix((values, (row[inside], place[inside])), shape=(outputs, samples))
