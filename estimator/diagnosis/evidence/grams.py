"""One pass over the data: Gram matrices of all columns, block by block of neighbouring rows.

Every test, every score on data left out, every step of the selection is then small algebra on these. A block of fewer
rows than columns is kept as its rows: they are the smaller, and what is asked of a block is the products of a few
columns.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design, read_rows, stretch_rows
from estimator.diagnosis.observed.drives_off import RECORDING
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import LEAST_ROWS, Stretch

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_BLOCKS = 12
"""Blocks that the rows are cut into, at least one a recording."""


@dataclass(frozen=True)
class Block:
    """Neighbouring rows of one recording: for each channel the Gram matrix (members + 1, members + 1), the residual
    last."""

    recording: int
    rows: int
    grams: list[Array]
    middle: float = math.nan
    """s, of its rows, in the recording's own time; a sum has none."""

    def among(self, kept: Sequence[Indices]) -> Block:
        """The products of some of each channel's columns alone."""
        grams = [gram[np.ix_(own, own)] for gram, own in zip(self.grams, kept, strict=True)]
        return Block(self.recording, self.rows, grams, self.middle)

    def times(self, count: int) -> Block:
        """The sum of as many that are alike."""
        return Block(self.recording, count * self.rows, [count * gram for gram in self.grams])


@dataclass(frozen=True)
class Sheet:
    """Neighbouring rows of one recording as they are: for each channel (members + 1, rows), the residual last."""

    recording: int
    columns: list[Array]
    middle: float

    @property
    def rows(self) -> int:
        return int(self.columns[0].shape[1])

    def among(self, kept: Sequence[Indices]) -> Block:
        """The products of some of each channel's columns alone."""
        return self._block([x[own] for x, own in zip(self.columns, kept, strict=True)])

    def summed(self) -> Block:
        """The products of all columns."""
        return self._block(self.columns)

    def compact(self) -> Block | Sheet:
        """The smaller of the rows and their products."""
        return self if all(x.shape[1] < x.shape[0] for x in self.columns) else self.summed()

    def _block(self, columns: Sequence[Array]) -> Block:
        return Block(self.recording, self.rows, [x @ x.T for x in columns], self.middle)


def sheets(
    design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise, parts: int = 1
) -> Iterator[Sheet]:
    """The rows of all stretches; ``decimations`` samples a row of each, at least ``parts`` sheets of each that is long
    enough. Last, what the design's torques read with the drives off."""
    total = sum(piece.signals.samples // decimation for piece, decimation in zip(pieces, decimations, strict=True))
    length = max(LEAST_ROWS, total // _BLOCKS)
    for piece, decimation in zip(pieces, decimations, strict=True):
        rows = stretch_rows(design, piece, decimation, noise)
        count = rows[0].shape[1]
        own = max(1, round(count / length), min(parts, count // LEAST_ROWS))
        edges = np.linspace(0, count, own + 1).astype(int)
        times = piece.signals.t[::decimation][noise.past :]
        for begin, end in pairwise(edges):
            yield Sheet(piece.recording, [x[:, begin:end] for x in rows], float(times[(begin + end) // 2]))
    if design.reading is not None:
        yield Sheet(RECORDING, read_rows(design, design.reading), math.nan)


def sum_up(
    design: Design, pieces: Sequence[Stretch], decimations: Sequence[int], noise: Noise, parts: int = 1
) -> list[Block]:
    """Gram matrices of all `sheets`."""
    return [sheet.summed() for sheet in sheets(design, pieces, decimations, noise, parts)]


def total(blocks: Sequence[Block | Sheet]) -> Block:
    """The sum of blocks."""
    kept = [block for block in blocks if isinstance(block, Sheet)]
    grams = [x @ x.T for x in (np.concatenate(parts, axis=1) for parts in zip(*(s.columns for s in kept), strict=True))]
    for block in blocks:
        if isinstance(block, Block):
            # The first sum is a copy: blocks stay as they are.
            grams = grams or [np.zeros_like(gram) for gram in block.grams]
            for gram, more in zip(grams, block.grams, strict=True):
                gram += more
    return Block(blocks[0].recording, sum(block.rows for block in blocks), grams)


def total_anew(whole: Block, blocks: Sequence[Block | Sheet], changed: Sequence[Indices]) -> Block:
    """The sum of blocks that was ``whole`` before the ``changed`` of each channel's columns were made anew."""
    rows = [block for block in blocks if isinstance(block, Sheet)]
    if len(rows) < len(blocks):
        return total(blocks)
    grams = []
    for channel, (gram, own) in enumerate(zip(whole.grams, changed, strict=True)):
        gram = gram.copy()
        gram[own] = sum(sheet.columns[channel][own] @ sheet.columns[channel].T for sheet in rows)
        gram[:, own] = gram[own].T
        grams.append(gram)
    return replace(whole, grams=grams)


def part_of(design: Design, blocks: Sequence[Block | Sheet], chosen: Sequence[int]) -> tuple[Design, list[Block]]:
    """The design with some of its candidates, and the blocks' products of what is left."""
    part = design.with_candidates([design.candidates[k] for k in chosen])
    former = np.concatenate([np.arange(design.given), *(design.candidates[k].columns for k in chosen)]).astype(np.intp)
    kept = [
        np.append(design.position[channel][former[members]], len(design.members[channel]))
        for channel, members in enumerate(part.members)
    ]
    return part, [block.among(kept) for block in blocks]


def of_each(blocks: Sequence[Block], folds: Sequence[int]) -> list[Block]:
    """For each fold, ascending, the sum of its own blocks."""
    return [
        total([block for block, own in zip(blocks, folds, strict=True) if own == fold]) for fold in sorted(set(folds))
    ]


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
