"""What is left out together: a motion, or a part of it, with all its playings, so that no repeat of it stays behind to
be learnt from."""

from __future__ import annotations

import math
from collections.abc import Hashable, Sequence
from dataclasses import dataclass

from estimator.diagnosis.evidence.grams import Block, Sheet
from estimator.diagnosis.observed.drives_off import RECORDING
from estimator.repeats import RepeatGroup

_MOTIONS = 4
"""From so many motions on, whole motions are left out; of fewer, too little would stay to be learnt from."""
_PARTS = 3
"""Parts that each recording has at least where parts of motions are left out …"""
_BLOCKS = 36
"""… of several motions as long as no more come of it than this."""


@dataclass(frozen=True)
class Folds:
    """For each block the number of the fold that it is left out with."""

    motions: tuple[int, ...]
    """Whole motions with all that repeats them, where there are several; else as ``parts``."""
    parts: tuple[int, ...] = ()
    """The blocks of all playings that lie in the same part of their motion; empty where the motions are told so."""


def motions(recordings: int, groups: Sequence[RepeatGroup]) -> list[int]:
    """For each recording the first one that is tied to it by repeated motions, through others if need be."""
    first = list(range(recordings))
    for group in groups:
        tied = {first[occurrence.trajectory] for occurrence in group.occurrences}
        first = [min(tied) if own in tied else own for own in first]
    return first


def parts_of(recordings: int, groups: Sequence[RepeatGroup]) -> int:
    """Blocks that each recording has to be cut into at least."""
    if len(set(motions(recordings, groups))) < _MOTIONS:
        return _PARTS
    return max(1, min(_PARTS, _BLOCKS // recordings))


def folds_of(blocks: Sequence[Block | Sheet], recordings: int, groups: Sequence[RepeatGroup]) -> Folds:
    """What each block is left out with.

    Where playings are shorter than a block, parts are blocks of neighbouring rows, each alone: the repeats of such a
    motion cannot be kept out.
    """
    motion = [*motions(recordings, groups), RECORDING]
    whole, parts = [motion[block.recording] for block in blocks], _by_part(blocks, groups)
    if len(set(parts)) < _PARTS:
        parts = list(range(len(blocks)))
    if len(set(whole) - {RECORDING}) < _MOTIONS:
        return Folds(_numbered(parts))
    return Folds(_numbered(whole), _numbered(parts))


def _numbered(keys: Sequence[Hashable]) -> tuple[int, ...]:
    number = {key: k for k, key in enumerate(dict.fromkeys(keys))}
    return tuple(number[key] for key in keys)


def _by_part(blocks: Sequence[Block | Sheet], groups: Sequence[RepeatGroup]) -> list[Hashable]:
    keys: list[Hashable] = [("alone", k) for k in range(len(blocks))]
    for number, group in enumerate(groups):
        phases = {k: phase for k, block in enumerate(blocks) if (phase := _phase(group, block)) is not None}
        parts = max(1, round(len(phases) / len(group.occurrences)))
        keys = [("part", number, math.floor(phases[k] * parts)) if k in phases else key for k, key in enumerate(keys)]
    return keys


def _phase(group: RepeatGroup, block: Block | Sheet) -> float | None:
    """0 … 1 (excluded): where in the repeated motion the middle of a block lies; None: it is no playing of it."""
    for occurrence in group.occurrences:
        phase = (block.middle - occurrence.start) / group.duration
        if occurrence.trajectory == block.recording and 0.0 <= phase < 1.0:
            return phase
    return None
