"""The evidence once more, with the causes' laws at the shapes that fit best.

A search tries each law on a grid of its non-linear parameters. Beside small noise even a shape near the true one leaves
something, which then has other names or is told as unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.accuracy import Searched
from estimator.diagnosis.design import Design
from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.grams import Block, Sheet, sheets
from estimator.diagnosis.refinement import Refined

Array = NDArray[np.float64]

WORTH = 10.0
"""nats that the refined shapes explain more than those of the grid: what is less has no name of its own."""


def sharpened(evidence: Evidence, found: Searched, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """``evidence``, in which the ``chosen`` were ``found``, with the shapes of ``refined`` in the place of theirs; None
    where they explain hardly more."""
    scores = found.scores
    if refined.explained < scores.nats(chosen) + WORTH:
        return None
    candidates, changed = list(evidence.design.candidates), set(chosen)
    for k, fitted in zip(chosen, refined.design.candidates, strict=True):
        for own in (k, *_of_the_same_shape(evidence.design, k, fitted.theta)):
            if own == k or own not in changed:
                candidates[own] = replace(candidates[own], theta=fitted.theta)
                changed.add(own)
    design = replace(evidence.design, candidates=tuple(candidates))
    return replace(evidence, design=design, blocks=tuple(_blocks(evidence, design, sorted(changed))))


def _of_the_same_shape(design: Design, candidate: int, theta: Array) -> Iterator[int]:
    """Of each law that contains a candidate's, or is contained, and is shaped by the same, as by the sharpness of a
    sign, the nearest candidate: it is to be compared with the other, and not with its sharpness."""
    own = design.hypotheses[design.candidates[candidate].hypothesis]
    for number, other in enumerate(design.hypotheses):
        within = own.effect.name in other.effect.contains or other.effect.name in own.effect.contains
        if other.place != own.place or not within:
            continue
        if not own.effect.hidden or other.effect.hidden != own.effect.hidden:
            continue
        forms = [k for k, form in enumerate(design.candidates) if form.hypothesis == number]
        forms = [k for k in forms if len(design.candidates[k].theta) == len(theta)]
        if forms:
            yield min(forms, key=lambda k: float(np.linalg.norm(design.candidates[k].theta - theta)))


def _blocks(evidence: Evidence, design: Design, changed: Sequence[int]) -> list[Block | Sheet]:
    """All rows with the ``changed`` candidates' columns made anew: those alone, where the others were kept as rows."""
    kept = [block for block in evidence.blocks if isinstance(block, Sheet)]
    alone = len(kept) == len(evidence.blocks)
    part = design.with_candidates([design.candidates[k] for k in changed]) if alone else design
    made = sheets(part, evidence.pieces, evidence.decimations, evidence.noise, evidence.parts)
    if not alone:
        return [sheet.compact() for sheet in made]
    return [_with_columns(sheet, design, changed, own, part) for sheet, own in zip(kept, made, strict=True)]


def _with_columns(sheet: Sheet, design: Design, changed: Sequence[int], made: Sheet, part: Design) -> Sheet:
    """A sheet of ``design`` with the columns of its ``changed`` candidates as ``made`` of ``part`` has them."""
    columns = [rows.copy() for rows in sheet.columns]
    for k, candidate in zip(changed, part.candidates, strict=True):
        for channel in candidate.channels:
            there = design.position[channel][design.candidates[k].columns]
            columns[channel][there] = made.columns[channel][part.position[channel][candidate.columns]]
    return replace(sheet, columns=columns)
