"""The thesis' own ways through the singular regressor: ridge regression (Eq. 4.9) and singular values (Section 4.5).

Both give all ten parameters of each link; the reduced set of `base_parameters` gives what they agree in.
"""

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


def svd_regression(regressor: Array, tau: Array, rank: int, prior: Array | None = None) -> Array:
    """psi = prior + V·S⁺·Uᵀ (tau − K·prior) with the ``rank`` largest singular values: what the data cannot tell stays
    the prior's (zero where None), the limit of `ridge_regression` for d towards zero.

    Shapes as there; ``rank`` from `base_parameters`. Columns are not scaled, so small singular values of weakly
    excited combinations amplify noise: that is what `identify_links` leaves out. Returns (10·n,).
    """
    stacked, measured = regressor.reshape(-1, regressor.shape[-1]), tau.reshape(-1)
    start = np.zeros(stacked.shape[1]) if prior is None else np.asarray(prior, dtype=float)
    u, singular, vt = np.linalg.svd(stacked, full_matrices=False)
    seen = (u[:, :rank].T @ (measured - stacked @ start)) / singular[:rank]
    return np.asarray(start + vt[:rank].T @ seen)


def smallest_nonzero_eigenvalue(regressor: Array, rank: int) -> float:
    """Of KᵀK, whose rank is known from `base_parameters`: what ``d`` must stay below."""
    stacked = regressor.reshape(-1, regressor.shape[-1])
    singular = np.linalg.svd(stacked, compute_uv=False)
    return float(singular[rank - 1] ** 2)
