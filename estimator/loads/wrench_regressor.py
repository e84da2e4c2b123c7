"""The wrench of a rigid load, linear in its ten inertial parameters: w = A·phi (thesis, Eq. 3.12).

Wrenches are (fx, fy, fz, nx, ny, nz) in the sensor's frame about its origin, N and N·m, as the sensor exerts them on
the load. Parameters are (m, mcx, mcy, mcz, Ixx, Ixy, Ixz, Iyy, Iyz, Izz) about the same origin.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.loads.frame_motion import FrameMotion

Array = NDArray[np.float64]

CHANNELS = ("fx", "fy", "fz", "nx", "ny", "nz")


def wrench_regressor(motion: FrameMotion) -> Array:
    """A of Eq. 3.12, (samples, 6, 10)."""
    result = np.zeros((len(motion), 6, 10))
    result[:, :3, 0] = motion.a
    result[:, :3, 1:4] = skew(motion.dw) + skew(motion.w) @ skew(motion.w)
    result[:, 3:, 1:4] = -skew(motion.a)
    result[:, 3:, 4:] = spread(motion.dw) + skew(motion.w) @ spread(motion.w)
    return result


def wrench_of_load(parameters: Array, motion: FrameMotion) -> Array:
    """Wrench (samples, 6) that a load of these parameters (10,) needs."""
    return np.asarray(wrench_regressor(motion) @ np.asarray(parameters, dtype=float))


def skew(x: Array) -> Array:
    """[x×] of Eq. 3.9, (samples, 3, 3)."""
    result = np.zeros((len(x), 3, 3))
    result[:, 0, 1], result[:, 0, 2], result[:, 1, 2] = -x[:, 2], x[:, 1], -x[:, 0]
    result[:, 1, 0], result[:, 2, 0], result[:, 2, 1] = x[:, 2], -x[:, 1], x[:, 0]
    return result


def spread(x: Array) -> Array:
    """[•x] of Eq. 3.10, (samples, 3, 6)."""
    result = np.zeros((len(x), 3, 6))
    result[:, 0, :3] = x
    result[:, 1, 1], result[:, 1, 3], result[:, 1, 4] = x.T
    result[:, 2, 2], result[:, 2, 4], result[:, 2, 5] = x.T
    return result
