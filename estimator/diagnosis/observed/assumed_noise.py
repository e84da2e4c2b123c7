"""A noise that no repeats tell: what the richest linear model leaves, told in the colour that it had before.

The model swallows noise where its columns have their energy, at the motion's own frequencies above all, so what it
leaves lacks just the noise that any cause must be told from. How much of a white noise it would leave is known at each
frequency, and what it does leave is counted by that.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence

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
Indices = NDArray[np.intp]

_TOLD = 1e-9
"""Of the largest singular value: smaller ones are rounding."""
_BANDS = 12
"""Of equal width, up to the highest frequency of the rows."""
_MUCH = 0.2
"""Of what the model leaves, what columns that no hypothesis has must explain to be the model's: it has a part of them
anyway, and as few others would explain less than a hundredth."""
_LEAST_LEFT = 0.15
"""Of a band: where the model leaves less of a white noise, the next band that it leaves more of speaks for it."""


def assumed_noise(
    stretches: Sequence[Sequence[Array]], unseen: Array, own: Mapping[int, Indices] | None = None
) -> tuple[Noise, dict[int, Array]]:
    """Without repeats: what the richest linear model leaves, widened.

    ``stretches`` hold for each channel (columns + 1, rows), the residual last. The model takes the principal directions
    of all hypotheses' columns, as many as a third of the rows: it swallows the effects. ``unseen`` (channels,
    ORDER + 1) is the autocovariance of errors that the model may have swallowed too. ``own``: by channel, which columns
    no hypothesis has; they are the model's too where they explain much of what it leaves without them, and of these
    channels what they have of each such column comes second.
    """
    covariance, freedom, explained = np.empty((len(stretches[0]), ORDER + 1)), np.inf, {}
    for channel in range(len(covariance)):
        parts = [stretch[channel] for stretch in stretches]
        rows = np.concatenate(parts, axis=1)
        apart = np.zeros(0, dtype=np.intp) if own is None else own.get(channel, np.zeros(0, dtype=np.intp))
        kept = _richest(np.delete(rows[:-1], apart, axis=0))
        residual = _without(rows[[-1]], kept)
        beside = _without(rows[apart], kept)
        more = _richest(beside)
        left = _without(residual, more)
        if np.sum(left**2) < (1.0 - _MUCH) * np.sum(residual**2):
            explained[channel] = np.linalg.lstsq(beside.T, residual[0], rcond=_TOLD)[0]
            kept, residual = np.vstack([kept, more]), left
        edges = np.cumsum([part.shape[1] for part in parts])[:-1]
        covariance[channel] = _autocovariance(np.split(np.vstack([kept, residual]), edges, axis=1))
        freedom = min(freedom, float(rows.shape[1] - len(kept)))
    covariance = WIDENED**2 * covariance + unseen
    noise = Noise(
        filters=np.array([autoregressive(row, freedom, ASSUMED_ORDER) for row in covariance]),
        rms=np.sqrt(covariance[:, 0]),
        degrees_of_freedom=0.0,
        playings=0,
        news=np.ones(len(covariance)),
        past=ASSUMED_ORDER,
    )
    return noise, explained


def _without(rows: Array, directions: Array) -> Array:
    """(k, rows) less what orthonormal directions have of them."""
    return np.asarray(rows - (rows @ directions.T) @ directions)


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
