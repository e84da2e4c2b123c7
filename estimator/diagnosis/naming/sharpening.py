"""The evidence once more, with the causes' laws at the shapes that fit best.

A search tries each law on a grid of its non-linear parameters. Beside small noise even a shape near the true one leaves
something, which then has other names or is told as unexplained.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import Block, Sheet, sheets
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.accuracy import Searched
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.bent_links import nats_changed
from estimator.diagnosis.naming.between_shapes import between_shapes
from estimator.diagnosis.naming.slow_forms import look_alikes

Array = NDArray[np.float64]

WORTH = 10.0
"""nats that the refined shapes explain more than those of the grid: what is less has no name of its own."""
_OTHER_DELAY = 0.1
"""Of a delay, by which it is another one than its shape's."""


def sharpened(evidence: Evidence, found: Searched, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """``evidence``, in which the ``chosen`` were ``found``, with the shapes of ``refined`` in the place of theirs, and
    with those that suit best what could stand in their stead or beside them; None where these explain hardly more than
    those of the grid."""
    scores, shapes = found.scores, dict[int, Array]()
    trials = [(list(chosen), refined), *look_alikes(evidence, scores, list(chosen))]
    # A contact that the grid has begin half a second late predicts no other motion: all but the rows left out admit it.
    if (refused := Admission(scores).one_sided(list(chosen))) is not None:
        trials.append(([*chosen, refused], fitted(evidence, scores, [*chosen, refused])))
    for trial, shaped in trials:
        if shaped.explained >= scores.nats(trial) + WORTH:
            # What was chosen has the shapes that it has as chosen, and not those beside another law.
            new = trial if shaped is refined else set(trial) - set(chosen)
            shapes |= {k: own.theta for k, own in zip(trial, shaped.design.candidates, strict=True) if k in new}
    shapes |= _as_large(evidence, scores, list(chosen), refined)
    shapes |= between_shapes(evidence, scores, chosen, refined)
    for k in chosen:
        for other, theta in _of_the_same_shape(evidence.design, k, shapes[k]) if k in shapes else ():
            shapes.setdefault(other, theta)
    if not shapes:
        return None
    candidates = list(evidence.design.candidates)
    for k, theta in shapes.items():
        candidates[k] = replace(candidates[k], theta=theta)
    design = replace(evidence.design, candidates=tuple(candidates))
    return replace(evidence, design=design, blocks=tuple(_blocks(evidence, design, sorted(shapes))))


def _as_large(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> dict[int, Array]:
    """By candidate the shapes of those of the chosen that are not linear in their coefficients, and so large that it
    shows, whether they explain more for it or not: the others that were chosen may have mended them, or the channels'
    timings a delay, which are not known better while its own shape needs them."""
    shapes = {}
    for k, fitted_one in zip(chosen, refined.design.candidates, strict=True):
        own, hypothesis = evidence.design.candidates[k], scores.hypothesis(k)
        if hypothesis.effect.timed(hypothesis.place) is not None:
            large = abs(float(fitted_one.theta[0] / own.theta[0]) - 1.0) > _OTHER_DELAY
        elif about := list(hypothesis.effect.about):
            theta = own.theta.copy()
            theta[about] = fitted_one.theta[about]
            other = replace(own, theta=theta)
            large = nats_changed(evidence, scores, chosen, k, other, evidence.pieces) > WORTH
        else:
            large = False
        if large:
            shapes[k] = fitted_one.theta
    return shapes


def _of_the_same_shape(design: Design, candidate: int, theta: Array) -> Iterator[tuple[int, Array]]:
    """Of each law that contains a candidate's, or is contained, and is shaped by the same, as by the sharpness of a
    sign, the nearest candidates, shaped so: they are to be compared with the other, and not with its sharpness."""
    own = design.hypotheses[design.candidates[candidate].hypothesis]
    shape = theta[list(own.effect.hidden)]
    for number, other in enumerate(design.hypotheses):
        within = own.effect.name in other.effect.contains or other.effect.name in own.effect.contains
        hidden = list(other.effect.hidden)
        if other.place != own.place or not within or not hidden or len(hidden) != len(shape):
            continue
        forms = {k: form.theta for k, form in enumerate(design.candidates) if form.hypothesis == number}
        away = {k: float(np.linalg.norm(form[hidden] - shape)) for k, form in forms.items()}
        for k, form in forms.items():
            if away[k] == min(away.values()):
                shaped = form.copy()
                shaped[hidden] = shape
                yield k, shaped


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
