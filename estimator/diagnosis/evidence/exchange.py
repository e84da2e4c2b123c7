"""Torques beside angles that do not have their errors: what the motion does is there still, and noise is not.

A servo answers to the errors of its angles, so that a filter of the angles, such as a lag, explains the noise of the
torques, in rows left out too. The errors of another playing's angles are others, as an instrument's are
(Söderström and Stoica 1983), but not all: a motion that is repeated to less than a count is rounded alike each time.
At lower frequencies the motion stands far above all errors, which lie at all frequencies.
"""

from __future__ import annotations

from collections.abc import Callable, Iterator, Sequence
from dataclasses import replace
from functools import cached_property, partial

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.diagnosis.evidence.design import Candidate, Design, candidate_rows, read_rows, stretch_rows
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import Grid, Stretch
from estimator.repeats import Occurrence, RepeatGroup

Array = NDArray[np.float64]

_LEAST_ROWS = 40
"""Of a playing, below which they tell nothing."""


class Exchange:
    """Stretches whose residuals have other errors than their motion; cut, and their columns made, when they are first
    asked of."""

    def __init__(
        self, make: Callable[[], Sequence[Stretch]], grid: Grid, noise: Noise, whole: Sequence[Stretch] = ()
    ) -> None:
        """``make`` the stretches; ``whole`` those of which they have a part of the motion alone."""
        self.of_a_part = bool(whole)
        self.untold = 0.0 if whole else 1.0
        """Share of what a law explains that counts as there, where next to nothing of its columns is."""
        self._make, self._grid, self._noise, self._whole = make, grid, noise, whole
        self._made: dict[tuple[float, ...], list[Array]] = {}

    @cached_property
    def pieces(self) -> tuple[Stretch, ...]:
        """Those that are long enough to tell anything."""
        return tuple(piece for piece in self._make() if piece.signals.samples // self._step(piece) >= _LEAST_ROWS)

    def among(self, design: Design) -> Block:
        """The products of a design's columns with each other, and with residuals that have other errors."""
        rows = self._rows_of(design)
        return Block(0, rows[0].shape[1], [x @ x.T for x in rows])

    def within(self, design: Design, candidate: Candidate, value: Array) -> Block:
        """The same where all residuals are what one of the design's candidates has with the coefficients ``value`` (c,)
        in the whole motion: of what acts in moments, the slow part may have them elsewhere."""
        of_whole = self._rows((-1, candidate.hypothesis, *candidate.theta), partial(self._of_whole, design, candidate))
        rows = [np.vstack([own[:-1], np.zeros(own.shape[1])]) for own in self._rows_of(design)]
        for channel, own in zip(candidate.channels, of_whole, strict=True):
            rows[channel][-1, : own.shape[1]] = value @ own
        return Block(0, rows[0].shape[1], [x @ x.T for x in rows])

    def _of_whole(self, design: Design, candidate: Candidate, stretch: Stretch, step: int, noise: Noise) -> list[Array]:
        """A candidate's rows where a stretch lies, of the whole motion."""
        t = stretch.signals.t
        for own in (p for p in self._whole if p.recording == stretch.recording):
            span = slice(*map(int, np.searchsorted(own.signals.t, [t[0] - 1e-9, t[-1] + 1e-9])))
            if span.stop - span.start == len(t):
                whole = replace(stretch, signals=own.signals.part(span, t))
                return candidate_rows(design, candidate, whole, step, noise)
        return candidate_rows(design, candidate, stretch, step, noise)

    def _rows_of(self, design: Design) -> list[Array]:
        given = self._rows((), lambda *how: stretch_rows(design.with_candidates([]), *how))
        parts = [[rows[:-1]] for rows in given]
        for candidate in design.candidates:
            own = self._rows((candidate.hypothesis, *candidate.theta), partial(candidate_rows, design, candidate))
            for channel, rows in zip(candidate.channels, own, strict=True):
                parts[channel].append(rows)
        whole = [np.concatenate([*own, rows[-1:]]) for own, rows in zip(parts, given, strict=True)]
        if design.reading is not None:
            # What is read with the drives off has no motion whose errors it could answer to.
            whole = [np.hstack(both) for both in zip(whole, read_rows(design, design.reading), strict=True)]
        return whole

    def _rows(self, key: tuple[float, ...], make: Callable[[Stretch, int, Noise], list[Array]]) -> list[Array]:
        """For each channel of what ``make`` makes of a stretch (columns, rows), those of all stretches; once."""
        if key not in self._made:
            made = [make(piece, self._step(piece), self._noise) for piece in self.pieces]
            self._made[key] = [np.concatenate(channel, axis=1) for channel in zip(*made, strict=True)]
        return self._made[key]

    def _step(self, piece: Stretch) -> int:
        return self._grid.decimation(piece.signals.period)


def exchange(pieces: Sequence[Stretch], groups: Sequence[RepeatGroup], grid: Grid, noise: Noise) -> Exchange:
    """Each playing with the residual of the next of its motion."""
    return Exchange(lambda: list(_mixed(pieces, groups)), grid, noise)


def with_slow_motion(
    slow: Callable[[], Sequence[Stretch]], whole: Sequence[Stretch], grid: Grid, noise: Noise
) -> Exchange:
    """Each stretch with the slow part of its motion alone (`Evidence.slow`): what a law explains by more than that, it
    explains by errors."""
    return Exchange(slow, grid, noise, whole)


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
    # What changes with time or temperature alone, as a drift does, goes with the torques.
    signals = replace(piece.signals.part(span, moments), temperature=_temperature(donor, moments))
    residual = CubicSpline(given, donor.residual)(moments)
    yield Stretch(donor.recording, signals, residual, piece.rounding[span], piece.power)


def _temperature(donor: Stretch, moments: Array) -> Array | None:
    """(samples, n) °C of a stretch at other times."""
    told = donor.signals.temperature
    if told is None:
        return None
    return np.column_stack([np.interp(moments, donor.signals.t, own) for own in told.T])
