"""The noise of each channel's rows: from repeats, where the same motion was played again; else assumed, and wide.

Rows are decimated samples; their noise is coloured, so it is described by an autoregressive filter that makes it white
with variance one.
"""

from __future__ import annotations

from collections.abc import Iterator, Mapping, Sequence
from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import solve_toeplitz
from scipy.ndimage import correlate1d

from estimator.diagnosis.observed.turning import REST, Spread, Turning, factor
from estimator.filtering import Decimator

Array = NDArray[np.float64]

ORDER = 12
ASSUMED_ORDER = 4
"""Of a noise that no repeats tell: its colour is known roughly."""
_ROWS_A_COEFFICIENT = 40
WIDENED = 1.3
"""Factor on the standard deviation of a noise that no repeats tell."""


@dataclass(frozen=True)
class Noise:
    """Noise of all channels."""

    filters: Array
    """(channels, ORDER + 1) of the whitening filters: rows times this have unit variance."""
    rms: Array
    """(channels,) of the rows."""
    degrees_of_freedom: float
    """Behind the variances; 0 where they are assumed."""
    playings: int
    """How many playings of repeated motions they come from; 0 without repeats."""
    news: Array
    """(channels,) of what independent rows would tell, how much these do: playings of one motion tell errors that they
    have in common more than once. One without such errors."""
    past: int = ORDER
    """Rows before each that the filters look at."""
    turning: Mapping[int, Turning] = field(default_factory=dict)
    """By channel, errors of reversals beside this noise, where there are any."""

    @property
    def likely(self) -> Array:
        """(channels,) `rms` without the widening of a noise that is assumed."""
        return self.rms if self.playings else self.rms / WIDENED

    @classmethod
    def none(cls, channels: int, past: int = ORDER) -> Noise:
        """Leaves rows as they are, but for the first few."""
        filters = np.zeros((channels, ORDER + 1))
        filters[:, 0] = 1.0
        return cls(filters, np.ones(channels), 0.0, 0, np.ones(channels), past)

    def whiten(self, channel: int, rows: Array) -> Array:
        """(columns, rows − past) of (columns, rows): the first few serve as the filter's past."""
        taps = self.filters[channel, self.past :: -1]
        centre = len(taps) // 2
        return np.asarray(correlate1d(rows, taps, axis=-1)[..., centre : centre + max(rows.shape[-1] - self.past, 0)])

    def spread(self, channel: int, decimation: int) -> Spread:
        """Of errors in single samples over a channel's rows."""
        decimate = Decimator(decimation)
        return Spread(lambda samples: self.whiten(channel, decimate(samples)), decimation)

    def of_turns(self, channel: int, q: Array, dq: Array, decimation: int) -> Array | None:
        """What `turning.settled` takes, of a channel's rows during a motion with these angles and speeds (samples, n);
        None where they are white as they are."""
        turning = self.turning.get(channel)
        rows = -(-len(q) // decimation) - self.past
        if turning is None or rows <= 0:
            return None
        variance = turning.variance(q, dq, REST * decimation)
        return factor(self.spread(channel, decimation).covariance(variance, rows))


def autoregressive(autocovariance: Array, rows: float, most: int = ORDER) -> Array:
    """(ORDER + 1,) whitening filter of noise with this autocovariance (ORDER + 1,) seen over so many rows, of ``most``
    so many coefficients."""
    order = int(min(most, rows // _ROWS_A_COEFFICIENT))
    result = np.zeros(ORDER + 1)
    variance = max(float(autocovariance[0]), np.finfo(float).tiny)
    if order == 0:
        result[0] = 1.0 / np.sqrt(variance)
        return result
    column = autocovariance[:order].copy()
    column[0] *= 1.0 + 1e-6
    prediction = solve_toeplitz(column, autocovariance[1 : order + 1])
    innovation = max(float(variance - prediction @ autocovariance[1 : order + 1]), 1e-6 * variance)
    # On the rows that it was fitted to, the model predicts better than on others.
    innovation *= 1.0 + 2.0 * order / rows
    result[: order + 1] = np.append(1.0, -prediction) / np.sqrt(innovation)
    return result


def whitened_variance(filters: Array, covariance: Array) -> Array:
    """(channels,) variance of errors with this autocovariance (channels, ORDER + 1) after each channel's filter."""
    lags = np.abs(np.subtract.outer(np.arange(ORDER + 1), np.arange(ORDER + 1)))
    return np.asarray(np.einsum("ka,kab,kb->k", filters, covariance[:, lags], filters))


def autocovariance(pieces: Sequence[Array]) -> Array:
    """(channels, ORDER + 1) of pieces (rows, channels) each."""
    rows = sum(len(piece) for piece in pieces)
    result = np.zeros((pieces[0].shape[1], ORDER + 1))
    for piece in pieces:
        for lag in range(min(ORDER + 1, len(piece))):
            result[:, lag] += np.sum(piece[: len(piece) - lag] * piece[lag:], axis=0)
    return result / max(rows, 1)


def in_bands(spectra: Array, bands: int) -> Array:
    """(…, bands) sums over bins of equal shares of all frequencies; ``spectra`` (…, bins) without the constant."""
    bins = spectra.shape[-1]
    band = np.minimum(np.arange(bins) * bands // max(bins, 1), bands - 1)
    return np.asarray(spectra @ (band[:, None] == np.arange(bands)).astype(np.float64))


def with_density(density: Array) -> Array:
    """(…, ORDER + 1) autocovariance of rows with a spectral density (…, bands) that is even within bands of equal
    width, up to the highest frequency of the rows."""
    bands = density.shape[-1]
    edges, lags = np.pi * np.arange(bands + 1) / bands, np.arange(1, ORDER + 1)[:, None]
    waves = np.diff(np.sin(edges * lags) / lags, axis=1) / np.pi
    return np.asarray(density @ np.vstack([np.full(bands, 1.0 / bands), waves]).T)


def density_of(covariance: Array, bands: int) -> Array:
    """(…, bands) spectral density of rows with this autocovariance (…, ORDER + 1), which a triangle tapers so that none
    is negative."""
    lags = np.arange(1, ORDER + 1)
    waves = np.cos(np.outer(lags, np.pi * (np.arange(bands) + 0.5) / bands)) * (1.0 - lags / (ORDER + 1.0))[:, None]
    return np.asarray(covariance[..., :1] + 2.0 * covariance[..., 1:] @ waves)


def runs(values: Array) -> Iterator[slice]:
    """Stretches of rows without NaN."""
    good = np.isfinite(values).all(axis=1)
    edges = np.flatnonzero(np.diff(np.concatenate([[False], good, [False]]).astype(int)))
    for begin, end in zip(edges[::2], edges[1::2], strict=True):
        yield slice(int(begin), int(end))
