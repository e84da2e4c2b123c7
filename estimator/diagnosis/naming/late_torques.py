"""Laws of torques that are recorded late, by the motion that these answer to.

A channel that is late is late with all that it holds: a friction's sign turns over as much later as the rigid body's
torque is. Beside the angles of the same moment, a friction that is far above the noise is then another one at every
reversal, and bristles, springs and links would mend it.
"""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Candidate, Design, Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence, weighed_again
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.own_shapes import shaped_by_coefficients
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.bent_links import bent, nats_changed
from estimator.diagnosis.observed.spending import spending
from estimator.diagnosis.observed.stretches import Stretch
from estimator.effects import Lateness

Array = NDArray[np.float64]

_OF_JOINTS = 10.0
"""nats that delays of single joints explain together beside that of all, to be any joint's own."""
_ANOTHER = 0.25
"""Of the delay that a shape was made of: one that is farther from it is another one."""
_WORTH = 3.0
"""nats that a cause must be expected to explain more beside the motion that the torques answer to."""


def with_late_torques(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """The evidence with columns of the motion that torques answer to, where some of them were found late among the
    ``chosen``, or all angles; None where that changes none of the other causes, nor what they are late by. Where
    repeats tell the noise, it is told anew: how sure torques are about reversals depends on it."""
    delays = {k: one for k, one in zip(chosen, _as_late(refined), strict=True) if _timed(scores.hypothesis(k))}
    late = _lateness(evidence.design, delays.values())
    if not late.differs_from(evidence.late):
        return None
    pieces = spending(answering(evidence.pieces, late), evidence.spent)
    causes = [k for k in chosen if k not in delays]
    design = evidence.design
    another = any(np.any(design.candidates[k].theta[1:] != one.theta[1:]) for k, one in delays.items())
    # Beside a late angle a delay of torques is one of other torques, and hardly told from the channel's timing.
    others = late.angles.any() and len(delays) > np.count_nonzero(late.angles)
    if not (another or others) and all(
        nats_changed(evidence, scores, list(chosen), k, design.candidates[k], pieces) <= _WORTH for k in causes
    ):
        return None
    # Beside smaller errors of the others a delay of the grid is hardly the right one, and delays of joints mend it. Its
    # form was told by the rigid body's torques, before all laws went with it.
    design = design.with_candidates([delays.get(k, one) for k, one in enumerate(design.candidates)])
    for one in delays.values():
        design = _of_form(design, one.hypothesis, one.theta)
    slow = cache(lambda: spending(answering(evidence.slow(), late), evidence.spent))
    if not evidence.noise.playings:
        blocks = [one.compact() for one in sheets(design, pieces, evidence.decimations, evidence.noise, evidence.parts)]
        return replace(evidence, design=design, pieces=tuple(pieces), blocks=tuple(blocks), slow=slow, late=late)
    found = weighed_again(evidence, design, evidence.unseen, pieces, slow)
    return replace(found, late=late)


def _of_form(design: Design, hypothesis: int, theta: Array) -> Design:
    """With the candidates of one hypothesis that are of one form with ``theta``."""
    return design.with_candidates(
        [c for c in design.candidates if c.hypothesis != hypothesis or np.array_equal(c.theta[1:], theta[1:])]
    )


def late_alike(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """Without delays of single joints where that of all torques explains hardly less alone: together they imitate a
    filter that is nearly its form."""
    delays = [k for k in chosen if _timed(scores.hypothesis(k))]
    alike = [k for k in delays if scores.hypothesis(k).place.joint is None]
    if not alike or len(delays) - len(alike) < 2:
        return chosen, refined
    fewer = [k for k in chosen if k in alike or k not in delays]
    shaped = fitted(evidence, scores, fewer)
    return (fewer, shaped) if shaped.explained >= refined.explained - _OF_JOINTS else (chosen, refined)


def as_fitted(evidence: Evidence, pieces: Sequence[Stretch]) -> list[Stretch]:
    """Stretches with the links, the motion that torques answer to, and what motors give these for, of which the
    evidence's laws are made."""
    return spending(answering(bent(pieces, evidence.bend), evidence.late), evidence.spent)


def answering(pieces: Sequence[Stretch], late: Lateness | None) -> list[Stretch]:
    """The same stretches with the motion that such torques answer to, for all laws of torques; what is left of the
    measured torques stays."""
    if late is None:
        return list(pieces)
    return [replace(p, signals=p.signals.as_recorded.answering_to(late)) for p in pieces]


def _as_late(refined: Refined) -> list[Candidate]:
    """The candidates; a delay that is fitted no worse with the shape of quite another one, by what is late in all."""
    candidates = refined.design.candidates
    told = shaped_by_coefficients(refined.design, refined.value, candidates)
    return [
        by_value if len(own.theta) and abs(by_value.theta[0] - own.theta[0]) > _ANOTHER * own.theta[0] else own
        for own, by_value in zip(candidates, told, strict=True)
    ]


def _lateness(design: Design, delays: Iterable[Candidate]) -> Lateness:
    """What is recorded late by some delays."""
    laws = [(design.hypotheses[one.hypothesis], one.theta) for one in delays]
    return Lateness.together(design.body.n, (law.effect.lateness(design.body, law.place, x) for law, x in laws))


def _timed(hypothesis: Hypothesis) -> bool:
    effect, place = hypothesis.effect, hypothesis.place
    return effect.timed(place) is not None and effect.equation_at(place) == "torque"
