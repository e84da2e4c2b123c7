"""Frictions that drift between the playings of a motion: their differences are no noise.

What drifts is smooth, and a noise that holds it is predictable: made white by that, a drift all but vanishes. So the
noise is told first of what the richest drift leaves, and drifts are judged by that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from estimator.diagnosis.evidence.design import Candidate, Design, candidate_columns
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.own_friction import OWN, own_friction
from estimator.diagnosis.observed.repetition import lay, playings
from estimator.diagnosis.observed.stretches import Grid, Stretch
from estimator.repeats import RepeatGroup

Array = NDArray[np.float64]

_BY_CHANCE = 1e-4
"""Probability that noise alone looks so much like a drift of some channel."""
_ROWS_A_COLUMN = 40
"""Of difference, at least: with fewer, a fit takes noise away."""
_DIFFER = 0.01
"""Of a drift, below which playings have all of it alike."""
_TOLD = 1e-2
"""Of the largest direction of a channel's drifts: in smaller ones they are alike."""
_MOST = 0.5
"""Of what playings differ by, from which on a friction is another one in each."""


@dataclass(frozen=True)
class Drifts:
    """What frictions make playings of one motion differ by."""

    left: list[Array]
    """Rows of all playings (`playings`) without what drifts with time or temperature, or is a friction of their own."""
    restless: dict[int, Array]
    """By torque whose joint's friction is another one in each recording, and goes with neither, the standard deviations
    (OWN,) of `own_friction` between playings."""


def drifts(
    design: Design,
    pieces: Sequence[Stretch],
    grid: Grid,
    repeats: Sequence[RepeatGroup],
    rows: Sequence[Array],
    noise_of: Callable[[Sequence[Array]], Noise | None],
) -> Drifts:
    """Of each torque among ``rows`` (`playings`) where chance would not make as much; ``noise_of`` tells the noise of
    such rows."""
    rows_apart = sum((stack.shape[1] - 1) * stack.shape[2] for stack in rows)
    told: dict[int, tuple[list[Array], list[Array]]] = {}
    for channel, candidates in _by_channel(design).items():
        if rows_apart >= _ROWS_A_COLUMN * len(candidates):
            made = zip(*(_columns(design, candidates, channel, piece) for piece in pieces), strict=True)
            laid = [playings(repeats, grid, lay(pieces, columns)) for columns in made]
            told[channel] = _that_differ(laid[0]), laid[1]
    richest, white = [stack.copy() for stack in rows], Noise.none(len(design.channels), past=0)
    for channel, (courses, frictions) in told.items():
        value, _ = _fitted(_apart(white, channel, _of(richest, channel)), _apart(white, channel, courses))
        _take_away(richest, channel, courses, value)
        _take_away_from_each(richest, channel, frictions)
    left, restless, noise = [stack.copy() for stack in rows], {}, noise_of(richest)
    apart_each = all(len({one.trajectory for one in group.occurrences}) == len(group.occurrences) for group in repeats)
    if noise is None:
        return Drifts(left, {})
    for channel, (courses, frictions) in told.items():
        apart = _apart(noise, channel, _of(left, channel))
        value, chance = _fitted(apart, _apart(noise, channel, courses))
        if chance < _BY_CHANCE / len(told):
            _take_away(left, channel, courses, value)
            continue
        without = _apart(noise, channel, _of(richest, channel))
        if apart_each and np.sum(without**2) < (1.0 - _MOST) * np.sum(apart**2):
            restless[channel] = _take_away_from_each(left, channel, frictions)
    return Drifts(left, restless)


def _by_channel(design: Design) -> dict[int, list[Candidate]]:
    """The drifts that enter each torque, each course of them once: how sharp a sign is hardly matters here."""
    result: dict[int, list[Candidate]] = {}
    seen: set[tuple[int, bytes]] = set()
    for candidate in design.candidates:
        law = design.hypotheses[candidate.hypothesis].effect
        course = candidate.hypothesis, np.delete(candidate.theta, law.hidden).tobytes()
        if law.drifts and course not in seen:
            seen.add(course)
            result.setdefault(candidate.channels[0], []).append(candidate)
    return result


def _columns(design: Design, candidates: Sequence[Candidate], channel: int, piece: Stretch) -> tuple[Array, Array]:
    """(samples, candidates) of the first values of drifts, from which those of the last differ by what recurs; and
    (samples, OWN) of frictions that do not drift."""
    first = [
        candidate_columns(design, candidate, piece.signals)[:, candidate.channels.index(channel), 0]
        for candidate in candidates
    ]
    return np.stack(first, axis=1), own_friction(piece.signals, design.channels[channel].index)


def _that_differ(courses: Sequence[Array]) -> list[Array]:
    """The columns that playings differ by: of motions that begin with their recordings all have the same times."""
    apart = sum(np.sum((stack - stack.mean(axis=1, keepdims=True)) ** 2, axis=(0, 1, 2)) for stack in courses)
    differ = apart > _DIFFER**2 * sum(np.sum(stack**2, axis=(0, 1, 2)) for stack in courses)
    return [stack[..., differ] for stack in courses]


def _of(rows: Sequence[Array], channel: int) -> list[Array]:
    return [stack[..., [channel]] for stack in rows]


def _apart(noise: Noise, channel: int, rows: Sequence[Array]) -> Array:
    """(rows, columns) of one phase, white as a channel's noise is: by what playings differ from their motion's mean."""
    pieces = [one for stack in rows for one in stack[0] - stack[0].mean(axis=0)]
    return np.concatenate([noise.whiten(channel, one.T).T for one in pieces])


def _fitted(apart: Array, columns: Array) -> tuple[Array, float]:
    """(columns,) of what playings differ by (rows, 1), by least squares; and the probability that white noise of
    variance one has as much of them."""
    scale = np.sqrt(np.mean(columns**2, axis=0))
    scale[scale == 0.0] = 1.0
    value, _, rank, _ = np.linalg.lstsq(columns / scale, apart[:, 0], rcond=_TOLD)
    explained = float(np.sum((columns / scale @ value) ** 2))
    return value / scale, float(chi2.sf(explained, rank)) if rank else 1.0


def _take_away(rows: Sequence[Array], channel: int, columns: Sequence[Array], value: Array) -> None:
    for stack, own in zip(rows, columns, strict=True):
        stack[..., channel] -= own @ value


def _take_away_from_each(rows: Sequence[Array], channel: int, frictions: Sequence[Array]) -> Array:
    """What each playing differs by that goes with a friction of its own; (OWN,) standard deviations of these."""
    squares, freedom = np.zeros(OWN), 0
    for stack, own in zip(rows, frictions, strict=True):
        apart = stack[..., channel] - stack[..., channel].mean(axis=1, keepdims=True)
        for place in np.ndindex(apart.shape[:2]):
            value = np.linalg.lstsq(own[place], apart[place])[0]
            stack[*place, :, channel] -= own[place] @ value
            squares += value**2
        freedom += apart.shape[0] * (apart.shape[1] - 1)
    return np.sqrt(squares / freedom)
