"""The thesis' own way through the singular regressor: ridge regression (Eq. 4.9)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]


def ridge_regression(regressor: Array, tau: Array, d: float, prior: Array | None = None) -> Array:
    """psi = prior + (KᵀK + d·1)⁻¹ Kᵀ (tau − K·prior), Eq. 4.9 with the prior at zero.

    ``regressor`` (samples, n, 10·n), ``tau`` (samples, n), ``d`` in the units of KᵀK: well below its smallest non-zero
    eigenvalue, the identifiable combinations come out as least squares has them, and the others as near the prior
    as they can be. Returns (10·n,).
    """
    stacked, measured = regressor.reshape(-1, regressor.shape[-1]), tau.reshape(-1)
    start = np.zeros(stacked.shape[1]) if prior is None else np.asarray(prior, dtype=float)
    gram = stacked.T @ stacked + d * np.eye(stacked.shape[1])
    return np.asarray(start + np.linalg.solve(gram, stacked.T @ (measured - stacked @ start)))


def smallest_nonzero_eigenvalue(regressor: Array, rank: int) -> float:
    """Of KᵀK, whose rank is known from `base_parameters`: what ``d`` must stay below."""
    stacked = regressor.reshape(-1, regressor.shape[-1])
    singular = np.linalg.svd(stacked, compute_uv=False)
    return float(singular[rank - 1] ** 2)
