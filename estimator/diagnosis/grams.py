"""One pass over the data: Gram matrices of all columns, block by block of neighbouring rows.

Every test, every score on data left out, every step of the selection is then small algebra on these.
"""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.design import Design, stretch_rows
from estimator.diagnosis.noise import ORDER, Noise
from estimator.diagnosis.stretches import Stretch

Array = NDArray[np.float64]

_BLOCKS = 12
"""Blocks that the rows are cut into, at least one a recording."""
_LEAST_ROWS = 20


@dataclass(frozen=True)
class Block:
    """Neighbouring rows of one recording: for each channel the Gram matrix (members + 1, members + 1), the residual
    last."""

    recording: int
    rows: int
    grams: list[Array]
    middle: float = math.nan
    """s, of its rows, in the recording's own time; a sum has none."""


def sum_up(
    design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise, parts: int = 1
) -> list[Block]:
    """Gram matrices of all stretches; ``decimations`` samples a row of each, at least ``parts`` blocks of each that is
    long enough."""
    total = sum(piece.signals.samples // decimation for piece, decimation in zip(pieces, decimations, strict=True))
    length = max(_LEAST_ROWS, total // _BLOCKS)
    blocks: list[Block] = []
    for piece, decimation in zip(pieces, decimations, strict=True):
        rows = stretch_rows(design, piece, decimation, noise)
        count = rows[0].shape[1]
        if count < _LEAST_ROWS:
            continue
        own = max(1, round(count / length), min(parts, count // _LEAST_ROWS))
        edges = np.linspace(0, count, own + 1).astype(int)
        times = piece.signals.t[::decimation][ORDER:]
        for begin, end in pairwise(edges):
            grams = [x[:, begin:end] @ x[:, begin:end].T for x in rows]
            blocks.append(Block(piece.recording, int(end - begin), grams, float(times[(begin + end) // 2])))
    return blocks


def total(blocks: Sequence[Block]) -> Block:
    """The sum of blocks."""
    grams = [gram.copy() for gram in blocks[0].grams]
    for block in blocks[1:]:
        for gram, more in zip(grams, block.grams, strict=True):
            gram += more
    return Block(blocks[0].recording, sum(block.rows for block in blocks), grams)


def without_each(whole: Block, blocks: Sequence[Block], folds: Sequence[int]) -> list[Block]:
    """For each fold, ascending, the sum ``whole`` of all blocks without the fold's own."""
    result = []
    for fold in sorted(set(folds)):
        grams = [gram.copy() for gram in whole.grams]
        out = [block for block, own in zip(blocks, folds, strict=True) if own == fold]
        for block in out:
            for gram, more in zip(grams, block.grams, strict=True):
                gram -= more
        result.append(Block(whole.recording, whole.rows - sum(block.rows for block in out), grams))
    return result
