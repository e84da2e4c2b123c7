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
from estimator.diagnosis.evidence.gathered import Evidence, weighed
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.bent_links import bent, nats_changed
from estimator.diagnosis.observed.stretches import Stretch

Array = NDArray[np.float64]

_WORTH = 3.0
"""nats that a cause must be expected to explain more beside the motion that the torques answer to."""


def with_late_torques(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """The evidence with columns of the motion that torques answer to, where some of them were found late among the
    ``chosen``, or all angles; None where that changes none of the other causes. Where repeats tell the noise, it is
    told anew: how sure torques are about reversals depends on it."""
    late = _lateness(refined.design)
    if not late.any():
        return None
    pieces = answering(evidence.pieces, late)
    delays = {k: own for k, own in zip(chosen, refined.design.candidates, strict=True) if _timed(scores.hypothesis(k))}
    causes = [k for k in chosen if k not in delays]
    design = evidence.design
    if all(nats_changed(evidence, scores, list(chosen), k, design.candidates[k], pieces) <= _WORTH for k in causes):
        return None
    # Beside smaller errors of the others a delay of the grid is hardly the right one, and delays of joints mend it.
    candidates = [
        replace(own, theta=delays[k].theta) if k in delays else own for k, own in enumerate(design.candidates)
    ]
    design = replace(design, candidates=tuple(candidates))
    slow = cache(lambda: answering(evidence.slow(), late))
    if not evidence.noise.playings:
        blocks = [one.compact() for one in sheets(design, pieces, evidence.decimations, evidence.noise, evidence.parts)]
        return replace(evidence, design=design, pieces=tuple(pieces), blocks=tuple(blocks), slow=slow, late=late)
    found = weighed(design, evidence.grid, pieces, slow, evidence.unseen, evidence.recordings, evidence.repeats)
    return replace(found, tolerance=evidence.tolerance, bend=evidence.bend, late=late)


def as_fitted(evidence: Evidence, pieces: Sequence[Stretch]) -> list[Stretch]:
    """Stretches with the links, and the motion that torques answer to, of which the evidence's laws are made."""
    return answering(bent(pieces, evidence.bend), evidence.late)


def answering(pieces: Sequence[Stretch], late: Array | None) -> list[Stretch]:
    """The same stretches with each joint's motion so many s (n,) earlier for all laws of torques; what is left of the
    measured torques stays."""
    return list(pieces) if late is None else [replace(p, signals=p.signals.answering_to(late)) for p in pieces]


def _lateness(design: Design) -> Array:
    """(n,) s by which torques are late against the angles, by the delays among a design's candidates."""
    late = np.zeros(design.body.n)
    for candidate in design.candidates:
        hypothesis = design.hypotheses[candidate.hypothesis]
        if _timed(hypothesis):
            effect, place = hypothesis.effect, hypothesis.place
            late[list(effect.rows(design.body, place))] += effect.timed(place) * float(candidate.theta[0])
    return late


def _timed(hypothesis: Hypothesis) -> bool:
    effect, place = hypothesis.effect, hypothesis.place
    return bool(effect.timed(place)) and effect.equation_at(place) == "torque"
