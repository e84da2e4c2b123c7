"""Residual torques in N·m, before and after the findings, on the fitted data and on data left out."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Design, stretch_rows
from estimator.diagnosis.evidence.grams import Block, sum_up
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.noise import ORDER, Noise
from estimator.diagnosis.observed.stretches import Stretch

Array = NDArray[np.float64]


def torque_channels(design: Design) -> list[int]:
    """The channels that are torques, joint after joint."""
    return [k for k, channel in enumerate(design.channels) if channel.equation == "torque"]


def residual_power(design: Design, block: Block, value: Array) -> Array:
    """(channels,) mean square of the residual of all unknowns (size,) on a block of rows that are not whitened."""
    result = np.empty(len(design.channels))
    for channel, gram in enumerate(block.grams):
        direction = np.append(-value[design.members[channel]], 1.0)
        result[channel] = direction @ gram @ direction
    return result / block.rows


def plain_blocks(
    design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], parts: int = 1, past: int = ORDER
) -> list[Block]:
    """Grams of motions' rows in the channels' own units, in the same blocks as a noise with this ``past`` makes."""
    design = replace(design, reading=None)
    return sum_up(design, pieces, decimations, Noise.none(len(design.channels), past), parts)


def left_out_power(
    design: Design, weights: Array, whitened: Sequence[Block], plain: Sequence[Block], folds: Sequence[int]
) -> Array:
    """(channels,) mean square of the residual, each fold's by coefficients that the other folds gave."""
    square, rows = np.zeros(len(design.channels)), 0
    grams = [np.sum([block.grams[c] for block in whitened], axis=0) for c in range(len(design.channels))]
    everything = np.arange(design.size)
    for fold in sorted(set(folds)):
        out = [k for k, f in enumerate(folds) if f == fold]
        kept = [g - np.sum([whitened[k].grams[c] for k in out], axis=0) for c, g in enumerate(grams)]
        count = sum(b.rows for b in whitened) - sum(whitened[k].rows for k in out)
        model = Conditional(Weighted(design, Block(0, count, kept), weights), everything)
        for k in out:
            square += residual_power(design, plain[k], model.value) * plain[k].rows
            rows += plain[k].rows
    return np.asarray(square / rows)


def share_of_explainable(before: Array, after: Array, least: float) -> float | None:
    """Of what any model could explain, how much is explained, −1 … 1.

    ``before``, ``after`` (joints,) in multiples of each joint's noise variance, so that no noisy joint rules the
    others. None where the joints together do not exceed their noise by ``least``: there is nothing to explain.
    """
    explainable = float(np.sum(before - 1.0))
    if explainable < least:
        return None
    return float(np.clip(np.sum(before - after) / explainable, -1.0, 1.0))


def rows_of(design: Design, piece: Stretch, decimation: int, value: Array) -> Array:
    """(rows, channels) residual of all unknowns on one stretch, in the channels' own units."""
    rows = stretch_rows(design, piece, decimation, Noise.none(len(design.channels)))
    return np.array([x[-1] - value[members] @ x[:-1] for x, members in zip(rows, design.members, strict=True)]).T
