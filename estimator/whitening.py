"""Coloured noise: an autoregressive model of each joint's residual, turned into a weight on the lagged sums."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz

from estimator.sums import LAGS

Array = NDArray[np.float64]

_ROWS_A_COEFFICIENT = 40
"""Rows that must stand behind each autoregressive coefficient."""


def white_weight(variance: float) -> Array:
    """Weight (LAGS,) for white noise of this variance."""
    weight = np.zeros(LAGS)
    weight[0] = 1.0 / variance
    return weight


def whitening_weight(autocovariance: Array, rows: int) -> Array:
    """Weight (LAGS,) on lagged sums that stands for whitening both sides by the residual's autoregressive model.

    ``autocovariance`` (LAGS,) of the residual, of the highest order that its ``rows`` carry.
    """
    return weight_of_order(autocovariance, min(LAGS - 1, rows // _ROWS_A_COEFFICIENT))


def weight_of_order(autocovariance: Array, order: int) -> Array:
    """The same for the autoregressive model of that ``order``, below LAGS.

    With the whitening filter a, the whitened sums are r(0)·D_0 + Σ r(m)·(D_m + D_mᵀ), r the autocorrelation of a over
    the innovation's variance: no data are needed again.
    """
    if order == 0 or autocovariance[0] <= 0.0:
        return white_weight(max(float(autocovariance[0]), np.finfo(float).tiny))
    # A slight white floor keeps the recursion stable when the residual is almost a pure tone.
    column = autocovariance[:order].copy()
    column[0] *= 1.0 + 1e-6
    prediction = solve_toeplitz(column, autocovariance[1 : order + 1])
    innovation = float(autocovariance[0] - prediction @ autocovariance[1 : order + 1])
    innovation = max(innovation, 1e-6 * float(autocovariance[0]))
    a = np.concatenate([[1.0], -prediction])
    weight = np.zeros(LAGS)
    weight[: order + 1] = [a[: len(a) - lag] @ a[lag:] for lag in range(order + 1)]
    return weight / innovation
