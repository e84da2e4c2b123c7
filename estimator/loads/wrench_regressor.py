"""The wrench of a rigid load, linear in its ten inertial parameters: w = A·phi (thesis, Eq. 3.12 and 3.21 to 3.23).

Wrenches are (fx, fy, fz, nx, ny, nz) in the sensor's frame about its origin, N and N·m, as the sensor exerts them on
the load. Parameters are (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) about the same origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.loads.frame_motion import FrameMotion

Array = NDArray[np.float64]

CHANNELS = ("fx", "fy", "fz", "nx", "ny", "nz")


def wrench_regressor(motion: FrameMotion) -> Array:
    """A of Eq. 3.12, (samples, 6, 10)."""
    result = np.zeros((len(motion), 6, 10))
    result[:, :3, 0] = motion.a
    result[:, :3, 1:4] = _skew(motion.dw) + _skew(motion.w) @ _skew(motion.w)
    result[:, 3:, 1:4] = -_skew(motion.a)
    result[:, 3:, 4:] = _spread(motion.dw) + _skew(motion.w) @ _spread(motion.w)
    return result


def wrench_of_load(parameters: Array, motion: FrameMotion) -> Array:
    """Wrench (samples, 6) that a load of these parameters (10,) needs."""
    return np.asarray(wrench_regressor(motion) @ np.asarray(parameters, dtype=float))


def integrated_regressor(motion: FrameMotion, rate: float, window: int) -> Array:
    """∫A over consecutive windows (Eq. 3.22, 3.23) over their length, (windows, 6, 10); accelerations are not used.

    ``rate`` Hz; each window is ``window`` sampling intervals long and begins where the last one ends. Divided by its
    length it is the window's mean, so the unknowns, noise levels and residuals keep their units.
    """
    v, w = motion.v, motion.w
    length = window / rate
    # Eq. 3.28: the integral of an acceleration in turning axes; Eq. 3.29: of the angular acceleration.
    a = _steps(v, window) / length + window_means(np.cross(w, v) - motion.g, window)
    dw = _steps(w, window) / length
    result = np.zeros((len(a), 6, 10))
    result[:, :3, 0] = a
    result[:, :3, 1:4] = _skew(dw) + window_means(_skew(w) @ _skew(w), window)
    result[:, 3:, 1:4] = -_skew(a)
    result[:, 3:, 4:] = _spread(dw) + window_means(_skew(w) @ _spread(w), window)
    return result


def window_means(x: Array, window: int) -> Array:
    """Integral of ``x`` (samples, …) over each window, over its length: (windows, …).

    By a cubic spline: against the exact differences of velocities, the trapezoidal rule would bias the inertia.
    """
    edges = np.arange(0, len(x), window, dtype=float)
    spline = CubicSpline(np.arange(len(x), dtype=float), x, axis=0)
    return np.asarray(np.diff(spline.antiderivative()(edges), axis=0) / window)


def _steps(x: Array, window: int) -> Array:
    return np.diff(x[::window], axis=0)


def _skew(x: Array) -> Array:
    """[x×] of Eq. 3.9, (samples, 3, 3)."""
    result = np.zeros((len(x), 3, 3))
    result[:, 0, 1], result[:, 0, 2], result[:, 1, 2] = -x[:, 2], x[:, 1], -x[:, 0]
    result[:, 1, 0], result[:, 2, 0], result[:, 2, 1] = x[:, 2], -x[:, 1], x[:, 0]
    return result


def _spread(x: Array) -> Array:
    """[•x] of Eq. 3.10, (samples, 3, 6)."""
    result = np.zeros((len(x), 3, 6))
    result[:, 0, :3] = x
    result[:, 1, 1], result[:, 1, 3], result[:, 1, 4] = x.T
    result[:, 2, 2], result[:, 2, 4], result[:, 2, 5] = x.T
    return result
