"""A noise that no repeats tell: what the richest linear model leaves, told in the colour that it had before.

The model swallows noise where its columns have their energy, at the motion's own frequencies above all, so what it
leaves lacks just the noise that any cause must be told from. How much of a white noise it would leave is known at each
frequency, and what it does leave is counted by that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.observed.noise import (
    ASSUMED_ORDER,
    ORDER,
    WIDENED,
    Noise,
    autoregressive,
    in_bands,
    with_density,
)

Array = NDArray[np.float64]

_TOLD = 1e-9
"""Of the largest singular value: smaller ones are rounding."""
_BANDS = 12
"""Of equal width, up to the highest frequency of the rows."""
_LEAST_LEFT = 0.15
"""Of a band: where the model leaves less of a white noise, the next band that it leaves more of speaks for it."""


def assumed_noise(stretches: Sequence[Sequence[Array]], unseen: Array) -> Noise:
    """Without repeats: what the richest linear model leaves, widened.

    ``stretches`` hold for each channel (columns + 1, rows), the residual last. The model takes the principal directions
    of all hypotheses' columns, as many as a third of the rows: it swallows the effects. ``unseen`` (channels,
    ORDER + 1) is the autocovariance of errors that the model may have swallowed too.
    """
    covariance, freedom = np.empty((len(stretches[0]), ORDER + 1)), np.inf
    for channel in range(len(covariance)):
        parts = [stretch[channel] for stretch in stretches]
        rows = np.concatenate(parts, axis=1)
        kept = _richest(rows[:-1])
        residual = rows[-1] - (rows[-1] @ kept.T) @ kept
        edges = np.cumsum([part.shape[1] for part in parts])[:-1]
        covariance[channel] = _autocovariance(np.split(np.vstack([kept, residual]), edges, axis=1))
        freedom = min(freedom, float(rows.shape[1] - len(kept)))
    covariance = WIDENED**2 * covariance + unseen
    return Noise(
        filters=np.array([autoregressive(row, freedom, ASSUMED_ORDER) for row in covariance]),
        rms=np.sqrt(covariance[:, 0]),
        degrees_of_freedom=0.0,
        playings=0,
        news=np.ones(len(covariance)),
        past=ASSUMED_ORDER,
    )


def _richest(columns: Array) -> Array:
    """(directions, rows) orthonormal: the model's."""
    norms = np.linalg.norm(columns, axis=1)
    told = columns[norms > 0.0] / norms[norms > 0.0, None]
    if not len(told):
        return np.zeros((0, columns.shape[1]))
    _, values, directions = np.linalg.svd(told, full_matrices=False)
    # What is no direction of the columns but of their rounding would swallow noise by chance.
    return np.asarray(directions[values > _TOLD * values[0]][: columns.shape[1] // 3])


def _autocovariance(parts: Sequence[Array]) -> Array:
    """(ORDER + 1,) of the noise of which a model left the last row of each part (directions + 1, rows), the others
    being the model's directions."""
    power, left, whole = np.zeros((3, _BANDS))
    for part in parts:
        # The constant tells nothing: it is the mean of few rows.
        spectra = np.abs(np.fft.rfft(part, axis=1)[:, 1:]) ** 2 / part.shape[1]
        power += in_bands(spectra[-1], _BANDS)
        left += in_bands(1.0 - spectra[:-1].sum(axis=0), _BANDS)
        whole += in_bands(np.ones(spectra.shape[1]), _BANDS)
    told = np.flatnonzero(left > _LEAST_LEFT * np.maximum(whole, 1.0))
    density = np.zeros(_BANDS)
    if len(told):
        nearest = told[np.abs(np.arange(_BANDS)[:, None] - told).argmin(axis=1)]
        density = power[nearest] / left[nearest]
    return with_density(density)
