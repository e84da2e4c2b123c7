"""Laws of torques that are recorded late, by the motion that these answer to.

A channel that is late is late with all that it holds: a friction's sign turns over as much later as the rigid body's
torque is. Beside the angles of the same moment, a friction that is far above the noise is then another one at every
reversal, and bristles, springs and links would mend it.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Design, Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence, weighed_again
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.bent_links import bent, nats_changed
from estimator.diagnosis.observed.stretches import Stretch
from estimator.effects import Lateness

Array = NDArray[np.float64]

_OF_JOINTS = 10.0
"""nats that delays of single joints explain together beside that of all, to be any joint's own."""
_WORTH = 3.0
"""nats that a cause must be expected to explain more beside the motion that the torques answer to."""


def with_late_torques(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """The evidence with columns of the motion that torques answer to, where some of them were found late among the
    ``chosen``, or all angles; None where that changes none of the other causes, nor what they are late by. Where
    repeats tell the noise, it is told anew: how sure torques are about reversals depends on it."""
    late = _lateness(refined.design)
    if not late.differs_from(evidence.late):
        return None
    pieces = answering(evidence.pieces, late)
    delays = {k: own for k, own in zip(chosen, refined.design.candidates, strict=True) if _timed(scores.hypothesis(k))}
    causes = [k for k in chosen if k not in delays]
    design = evidence.design
    another = any(np.any(design.candidates[k].theta[1:] != own.theta[1:]) for k, own in delays.items())
    # Beside a late angle a delay of torques is one of other torques, and hardly told from the channel's timing.
    others = late.angles.any() and len(delays) > np.count_nonzero(late.angles)
    if not (another or others) and all(
        nats_changed(evidence, scores, list(chosen), k, design.candidates[k], pieces) <= _WORTH for k in causes
    ):
        return None
    # Beside smaller errors of the others a delay of the grid is hardly the right one, and delays of joints mend it. Its
    # form was told by the rigid body's torques, before all laws went with it.
    design = design.with_candidates([delays.get(k, own) for k, own in enumerate(design.candidates)])
    for own in delays.values():
        design = _of_form(design, own.hypothesis, own.theta)
    slow = cache(lambda: answering(evidence.slow(), late))
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
    """Stretches with the links, and the motion that torques answer to, of which the evidence's laws are made."""
    return answering(bent(pieces, evidence.bend), evidence.late)


def answering(pieces: Sequence[Stretch], late: Lateness | None) -> list[Stretch]:
    """The same stretches with the motion that such torques answer to, for all laws of torques; what is left of the
    measured torques stays."""
    if late is None:
        return list(pieces)
    return [replace(p, signals=p.signals.as_recorded.answering_to(late)) for p in pieces]


def _lateness(design: Design) -> Lateness:
    """What is recorded late by the delays among a design's candidates."""
    hypotheses = [(design.hypotheses[candidate.hypothesis], candidate.theta) for candidate in design.candidates]
    told = (law.effect.lateness(design.body, law.place, theta) for law, theta in hypotheses if _timed(law))
    return Lateness.together(design.body.n, told)


def _timed(hypothesis: Hypothesis) -> bool:
    effect, place = hypothesis.effect, hypothesis.place
    return effect.timed(place) is not None and effect.equation_at(place) == "torque"
