"""Torques beside angles that do not have their errors: what the motion does is there still, and noise is not.

A servo answers to the errors of its angles, so that a filter of the angles, such as a lag, explains the noise of the
torques, in rows left out too. The errors of another playing's angles are others, as an instrument's are
(Söderström and Stoica 1983). Where nothing was played twice, the motion is taken from lower frequencies alone: there it
stands far above the errors, which lie at all frequencies.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline

from estimator.diagnosis.design import Design
from estimator.diagnosis.grams import Block, sum_up, total
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.stretches import Grid, Stretch
from estimator.repeats import Occurrence, RepeatGroup

_LEAST_ROWS = 40
"""Of a playing, below which they tell nothing."""


@dataclass(frozen=True)
class Exchange:
    """Stretches whose residuals have other errors than their motion."""

    pieces: tuple[Stretch, ...]
    decimations: tuple[int, ...]
    noise: Noise
    untold: float
    """The share of what a law explains that counts as there, where next to nothing of its columns is."""

    def among(self, design: Design) -> Block:
        """The products of a design's columns with each other, and with residuals that have other errors."""
        return total(sum_up(design, self.pieces, self.decimations, self.noise))


def exchange(pieces: Sequence[Stretch], groups: Sequence[RepeatGroup], grid: Grid, noise: Noise) -> Exchange | None:
    """Each playing with the residual of the next of its motion; None where no motion recurs."""
    mixed = [
        (piece, step)
        for piece in _mixed(pieces, groups)
        if piece.signals.samples // (step := grid.decimation(piece.signals.period)) >= _LEAST_ROWS
    ]
    if not mixed:
        return None
    return Exchange(tuple(piece for piece, _ in mixed), tuple(step for _, step in mixed), noise, untold=1.0)


def with_slow_motion(slow: Sequence[Stretch], decimations: Sequence[int], noise: Noise) -> Exchange:
    """Each stretch with the slow part of its motion alone (`Evidence.slow`): what a law explains by more than that, it
    explains by errors."""
    return Exchange(tuple(slow), tuple(decimations), noise, untold=0.0)


def _mixed(pieces: Sequence[Stretch], groups: Sequence[RepeatGroup]) -> Iterator[Stretch]:
    for group in groups:
        following = (*group.occurrences[1:], group.occurrences[0])
        for own, other in zip(group.occurrences, following, strict=True):
            for piece in (p for p in pieces if p.recording == own.trajectory):
                for donor in (p for p in pieces if p.recording == other.trajectory):
                    yield from _with_residual_of(piece, own, donor, other, group.duration)


def _with_residual_of(
    piece: Stretch, own: Occurrence, donor: Stretch, other: Occurrence, duration: float
) -> Iterator[Stretch]:
    t, given, later = piece.signals.t, donor.signals.t, other.start - own.start
    first, last = max(own.start, given[0] - later), min(own.start + duration, given[-1] - later)
    span = slice(*map(int, np.searchsorted(t, [first, last])))
    if span.stop - span.start < 2:
        return
    moments = t[span] + later
    # What changes with time alone, as a drift does, goes with the torques.
    signals = piece.signals.part(span, moments)
    residual = CubicSpline(given, donor.residual)(moments)
    yield Stretch(donor.recording, signals, residual, piece.rounding[span], piece.power)
