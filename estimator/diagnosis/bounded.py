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


def bounded_fits(matrix: Array, score: Array, energy: Array, lower: Array, upper: Array) -> tuple[Array, Array]:
    """Coefficients x (k, c, m) that maximise xᵀ·score − ½·xᵀ·matrix·x within their limits, and the maxima (k, m).

    ``matrix`` (k, c, c) is what is left of the columns' products after other unknowns, ``energy`` (k, c) their squared
    norms before that: directions with next to nothing left are not used. ``score`` (k, c, m): m right-hand sides.
    ``lower``, ``upper`` (k, c); a limit other than zero or infinity cuts the solution without refitting the others.
    """
    k, c, m = score.shape
    best, chosen = np.zeros((k, m)), np.zeros((k, c, m))
    signed = np.any((lower == 0.0) | (upper == 0.0), axis=0)
    choices = [(True, False) if s and c <= _ENUMERATED else (True,) for s in signed]
    for used in product(*choices):
        mask = np.array(used)
        if not mask.any():
            continue
        inverse = _inverse(matrix[:, mask][:, :, mask], energy[:, mask])
        x = np.zeros((k, c, m))
        x[:, mask] = np.clip(inverse @ score[:, mask], lower[:, mask, None], upper[:, mask, None])
        value = (x * (score - 0.5 * (matrix @ x))).sum(axis=1)
        np.copyto(chosen, x, where=(value > best)[:, None, :])
        np.maximum(best, value, out=best)
    return chosen, best


def _inverse(matrix: Array, energy: Array) -> Array:
    """Pseudo-inverse (k, c, c), its cut-off relative to the energy that the columns had before."""
    scale = np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(matrix * scale[:, :, None] * scale[:, None, :])
    inverse = np.where(values > _SINGULAR, 1.0 / np.maximum(values, _SINGULAR), 0.0)
    inner = np.einsum("kab,kb,kcb->kac", vectors, inverse, vectors)
    return np.asarray(inner * scale[:, :, None] * scale[:, None, :])
