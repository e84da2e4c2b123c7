"""The integrated form of the load's equation: no acceleration is needed (thesis, Eq. 3.21 to 3.29).

An integral over a window holds the velocity at its ends alone, so noise of the velocities at all frequencies enters
that the rows' rate cannot carry: it aliases, makes the columns noisy, and drags the inertia towards zero. Hence both
sides go through the decimating low-pass first, which commutes with the derivative: what is integrated is
band-limited, and its columns are as clean as those of the differentiated form. A window's mean is taken, not its
integral, and each begins with the velocities measured at its start: initial conditions do not pile up along a
recording, and the unknowns, noise levels and residuals keep their units. Neighbouring windows share an end, so their
noise is correlated; the fit whitens it.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.signal import oaconvolve

from estimator.filtering import FilterPlan, root_raised_cosine
from estimator.loads.frame_motion import FrameMotion
from estimator.loads.wrench_regressor import skew, spread

Array = NDArray[np.float64]


def integrated_columns(
    channels: Sequence[int], motion: FrameMotion, sensor: list[Array], wrenches: list[Array], plan: FilterPlan
) -> list[Array]:
    """For each of ``channels`` (columns, windows): means over consecutive windows of `FilterPlan.decimation` samples of
    [parameters | ``sensor`` | each of ``wrenches``]."""
    window = plan.decimation
    regressor = integrated_regressor(motion, plan.rate, window)
    right = [_means(_smoothed(x[:, None], window), window)[:, 0] for x in sensor]
    measured = [_means(_smoothed(w, window), window) for w in wrenches]
    return [np.vstack([regressor[:, c].T, *right, *(w[:, k] for w in measured)]) for k, c in enumerate(channels)]


def integrated_regressor(motion: FrameMotion, rate: float, window: int) -> Array:
    """∫A over consecutive windows (Eq. 3.22, 3.23) over their length, (windows, 6, 10), behind the low-pass.

    ``rate`` Hz; each window is ``window`` sampling intervals long and begins where the last one ends.
    """
    length = window / rate
    ends = slice(None, None, window)
    v, w = (_smoothed(x, window)[ends] for x in (motion.v, motion.w))
    # Eq. 3.28: the integral of an acceleration in turning axes; Eq. 3.29: of the angular acceleration.
    a = np.diff(v, axis=0) / length + _means(_smoothed(np.cross(motion.w, motion.v) - motion.g, window), window)
    dw = np.diff(w, axis=0) / length
    turning = skew(motion.w)
    result = np.zeros((len(a), 6, 10))
    result[:, :3, 0] = a
    result[:, :3, 1:4] = skew(dw) + _means(_smoothed(turning @ turning, window), window)
    result[:, 3:, 1:4] = -skew(a)
    result[:, 3:, 4:] = spread(dw) + _means(_smoothed(turning @ spread(motion.w), window), window)
    return result


def lost_samples(window: int) -> int:
    """Samples of a segment that the low-pass takes from its ends together: the first window is as far from the start
    as half of them."""
    return len(root_raised_cosine(window)) - 1


def _smoothed(x: Array, window: int) -> Array:
    """The decimator's low-pass at every sample where its kernel lies inside: (samples − `lost_samples`, …)."""
    kernel = root_raised_cosine(window)
    flat = x.reshape(len(x), -1)
    smooth = oaconvolve(flat, kernel[:, None], mode="valid", axes=0)
    return np.asarray(smooth.reshape(-1, *x.shape[1:]))


def _means(x: Array, window: int) -> Array:
    """Integral of ``x`` (samples, …) over each window, over its length: (windows, …).

    By a cubic spline: against the exact differences of velocities, the trapezoidal rule would bias the inertia.
    """
    edges = np.arange(0, len(x), window, dtype=float)
    spline = CubicSpline(np.arange(len(x), dtype=float), x, axis=0)
    return np.asarray(np.diff(spline.antiderivative()(edges), axis=0) / window)
