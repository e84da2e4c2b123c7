"""Small least-squares problems with limited coefficients, many at once."""

from __future__ import annotations

from itertools import product

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_SINGULAR = 1e-9
"""Share of a column's energy below which nothing of it is left to fit."""
_ENUMERATED = 5
"""Up to so many signed coefficients all choices of zeros are tried; beyond, the free solution is cut to its limits."""


def bounded_gains(matrix: Array, score: Array, energy: Array, lower: Array, upper: Array) -> Array:
    """Maxima (k, m) of xᵀ·score − ½·xᵀ·matrix·x over coefficients x (c,) within their limits.

    ``matrix`` (k, c, c) is what is left of the columns' products after other unknowns, ``energy`` (k, c) their squared
    norms before that: directions with next to nothing left are not used. ``score`` (k, c, m): m right-hand sides.
    ``lower``, ``upper`` (k, c); a limit other than zero or infinity cuts the solution without refitting the others.
    """
    k, c, m = score.shape
    best = np.zeros((k, m))
    signed = np.any((lower == 0.0) | (upper == 0.0), axis=0)
    limited = bool(np.isfinite(lower).any() or np.isfinite(upper).any())
    choices = [(True, False) if s and c <= _ENUMERATED else (True,) for s in signed]
    for used in product(*choices):
        own = np.flatnonzero(used)
        if len(own):
            inner, pull = matrix[:, own[:, None], own], score[:, own]
            x = _inverse(inner, energy[:, own]) @ pull
            if limited:
                np.clip(x, lower[:, own, None], upper[:, own, None], out=x)
                pull = 2.0 * pull - inner @ x
            np.maximum(best, 0.5 * np.einsum("kcm,kcm->km", x, pull), out=best)
    return best


def _inverse(matrix: Array, energy: Array) -> Array:
    """Pseudo-inverse (k, c, c), its cut-off relative to the energy that the columns had before."""
    scale = np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0)
    if matrix.shape[1] == 1:
        alone = matrix[:, 0] * scale**2
        return np.asarray(np.where(alone > _SINGULAR, scale**2 / np.maximum(alone, _SINGULAR), 0.0)[:, :, None])
    matrix = matrix * scale[:, :, None] * scale[:, None, :]
    if matrix.shape[1] == 2:
        return _inverse_of_two(matrix) * scale[:, :, None] * scale[:, None, :]
    return _pseudo_inverse(matrix) * scale[:, :, None] * scale[:, None, :]


def _inverse_of_two(matrix: Array) -> Array:
    """Of (k, 2, 2), by Cramer's rule where both directions are told: most candidates have two columns."""
    (a, b), (_, d) = matrix.transpose(1, 2, 0)
    told = 0.5 * (a + d) - np.hypot(0.5 * (a - d), b) > _SINGULAR
    determinant = np.where(told, a * d - b * b, 1.0)
    result = np.array([[d, -b], [-b, a]]).transpose(2, 0, 1) / determinant[:, None, None]
    if not told.all():
        result[~told] = _pseudo_inverse(matrix[~told])
    return np.asarray(result)


def _pseudo_inverse(matrix: Array) -> Array:
    """Of normalised products (k, c, c), without directions of which next to nothing is left."""
    values, vectors = np.linalg.eigh(matrix)
    inverse = np.where(values > _SINGULAR, 1.0 / np.maximum(values, _SINGULAR), 0.0)
    return np.asarray((vectors * inverse[:, None, :]) @ vectors.swapaxes(1, 2))
