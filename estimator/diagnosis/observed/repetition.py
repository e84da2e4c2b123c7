"""What repeats say about a channel: its noise, and how much of it they can have in common."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.observed.noise import (
    Noise,
    autocovariance,
    autoregressive,
    density_of,
    in_bands,
    runs,
    whitened_variance,
    with_density,
)
from estimator.diagnosis.observed.stretches import Grid, Stretch
from estimator.filtering import Decimator
from estimator.repeats import RepeatGroup, aligned

Array = NDArray[np.float64]

_LEAST_ROWS = 60
"""Rows of difference that a noise must be judged by."""
_BANDS = 12
"""Of equal width, up to the highest frequency of the rows."""
_PHASES = 4
"""At most, of rows."""
_SURELY = 2.0
"""Standard errors."""
_MOST = 0.5
"""Of a channel's scatter: where more than this is left without its rests, they tell of the noise as other rows do."""
_RESTS = 0.01
"""Of a row, from which on rests are counted to it."""


@dataclass(frozen=True)
class Laid:
    """Channels of all recordings on even times, NaN where nothing was told: what `aligned` takes."""

    times: list[Array]
    values: list[Array]


def lay(pieces: Sequence[Stretch], channels: Sequence[Array]) -> Laid:
    """``channels`` (samples, k) of each stretch, put together recording by recording."""
    times: list[Array] = []
    values: list[Array] = []
    for recording in range(max(piece.recording for piece in pieces) + 1):
        own = [(p.signals.t, c) for p, c in zip(pieces, channels, strict=True) if p.recording == recording]
        if not own:
            times.append(np.arange(2.0))
            values.append(np.full((2, channels[0].shape[1]), np.nan))
            continue
        period = own[0][0][1] - own[0][0][0]
        start, end = min(t[0] for t, _ in own), max(t[-1] for t, _ in own)
        grid = start + period * np.arange(round((end - start) / period) + 1)
        laid = np.full((len(grid), channels[0].shape[1]), np.nan)
        for t, value in own:
            first = round((t[0] - start) / period)
            laid[first : first + len(t)] = value[: len(laid) - first]
        times.append(grid)
        values.append(laid)
    return Laid(times, values)


def playings(groups: Sequence[RepeatGroup], grid: Grid, laid: Laid) -> list[Array]:
    """Rows (phases, playings, rows, channels) of each stretch of each repeated motion that all its playings tell.

    The same rows begun a part of a row later are another phase: what is near half the rows' rate is seen by one phase
    where another is blind to it, and a noise of accelerations has most there.
    """
    result: list[Array] = []
    for group in groups:
        rate, stack = aligned(group, laid.times, laid.values)
        if stack.shape[1] < 2:
            continue
        count, samples, channels = stack.shape
        flat = stack.transpose(1, 0, 2).reshape(samples, count * channels)
        decimation = grid.decimation(1.0 / rate)
        decimate, phases = Decimator(decimation), np.unique(np.arange(_PHASES) * decimation // _PHASES)
        for run in runs(flat):
            rows = [decimate(flat[run][first:].T) for first in phases]
            least = min(own.shape[1] for own in rows)
            told = np.array([own[:, :least].reshape(count, channels, least) for own in rows])
            result.append(told.transpose(0, 1, 3, 2))
    return result


def repeated_noise(
    rows: Sequence[Array],
    unseen: Array,
    exact: Array,
    left: Sequence[Array] | None = None,
    rests: Sequence[Array] | None = None,
) -> Noise | None:
    """Noise from the deviations of ``rows`` (`playings`) from their mean, and ``unseen`` (channels, ORDER + 1), the
    autocovariance of errors that they have in common, of which there are no more than what they have in common;
    ``exact``, likewise, of what nothing is computed more exactly than. ``left``: the rows without what recurs for
    another reason, where some is known; ``rests``: rows of what is not zero where a channel says nothing of the noise.
    None where repeats are too short to tell."""
    if not rows:
        return None
    deviations = [
        one
        for stack in rows
        for phase in (stack - stack.mean(axis=1, keepdims=True)) * np.sqrt(stack.shape[1] / (stack.shape[1] - 1))
        for one in phase
    ]
    freedom = sum((stack.shape[1] - 1) * stack.shape[2] for stack in rows)
    if freedom < _LEAST_ROWS:
        return None
    unseen = _within_what_recurs(unseen, rows if left is None else left) + exact
    scatter, told = _scatter(deviations, freedom, rests or ())
    covariance = scatter + unseen
    filters = np.array([autoregressive(row, count) for row, count in zip(covariance, told, strict=True)])
    # Of R playings' rows, errors that recur in all of them leave 1/(1 + (R − 1)·share) of the information.
    again = sum(stack[0, ..., 0].size for stack in rows) / sum(stack.shape[2] for stack in rows) - 1.0
    common = np.clip(whitened_variance(filters, unseen), 0.0, 1.0)
    return Noise(
        filters=filters,
        rms=np.sqrt(covariance[:, 0]),
        degrees_of_freedom=float(freedom),
        playings=sum(stack.shape[1] for stack in rows),
        news=1.0 / (1.0 + again * common),
    )


def _scatter(deviations: Sequence[Array], freedom: int, rests: Sequence[Array]) -> tuple[Array, Array]:
    """(channels, ORDER + 1) autocovariance of ``deviations``, and (channels,) the degrees of freedom behind it, of all
    rows; of those without a channel's ``rests`` (`repeated_noise`) where these make most of it."""
    scatter = autocovariance(deviations)
    told = np.full(len(scatter), float(freedom))
    if not rests:
        return scatter, told
    moving: list[Array] = []
    for stack in rests:
        held_in_none = (np.abs(stack).max(axis=1) < _RESTS).astype(np.float64)
        moving += [phase for phase in held_in_none for _ in range(stack.shape[1])]
    share = np.concatenate(moving).mean(axis=0)
    # Rows at zero have no products, and are not counted.
    parted = autocovariance([one * own for one, own in zip(deviations, moving, strict=True)])
    without = (parted[:, 0] < _MOST * share * scatter[:, 0]) & (share * freedom >= _LEAST_ROWS)
    scatter[without] = parted[without] / share[without, None]
    told[without] *= share[without]
    return scatter, told


def _within_what_recurs(unseen: Array, rows: Sequence[Array]) -> Array:
    """(channels, ORDER + 1) ``unseen`` (channels, ORDER + 1) without what of it would be more, at any frequency, than
    the playings have in common there: causes and errors."""
    recurring, scatter = np.zeros((2, len(unseen), _BANDS))
    bins = np.zeros(_BANDS)
    for stack in rows:
        phases, count, samples, _ = stack.shape
        for phase in stack:
            mean = phase.mean(axis=0)
            # The constant tells nothing: it is one bin, and holds what stands.
            common, other = (np.abs(np.fft.rfft(x, axis=-2)[..., 1:, :]) ** 2 / samples for x in (mean, phase - mean))
            own = (common - other.sum(axis=0) / (count * (count - 1))).T
            recurring += in_bands(own, _BANDS)
            scatter += phases * in_bands(own**2, _BANDS)
            bins += in_bands(np.ones(own.shape[1]), _BANDS)
    most = (np.maximum(recurring, 0.0) + _SURELY * np.sqrt(scatter)) / np.maximum(bins, 1.0)
    density = density_of(unseen, _BANDS)
    return unseen - with_density(density - np.minimum(density, np.where(bins > 0.0, most, np.inf)))
