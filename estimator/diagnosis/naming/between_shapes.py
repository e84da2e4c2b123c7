"""Laws of a shape that no grid holds closely, sought between the grid's shapes where they may stand for other causes.

A wall is tried by twenty-six directions and three depths each. One that stands between two of them, and is met now and
then, leaves so much at either that several laws of one joint's angle explain more.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import groups_of, within_limits
from estimator.diagnosis.evidence.design import Candidate
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import sum_up, total
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.joint_or_arm import in_its_place, now_and_then
from estimator.effects import Scales

Array = NDArray[np.float64]

_SHARES = (1.0, 0.5, 0.25, 0.125)
"""Of what lies between two shapes of the grid: how far from the best ones others are tried, one round after the
other."""
_STARTS = 3
"""Shapes about which others are tried."""
_HOPELESS = 0.1
"""Of what causes explain, the least that a shape of the grid explains in their stead …"""
_LEAST = 0.5
"""… and the least that one between them does, to be kept."""
_BETTER = 10.0
"""nats that it explains more than the best of the grid."""


def between_shapes(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> dict[int, Array]:
    """For candidates of laws that are `Law.sought`, shapes that explain more than those of the grid: of such a law that
    stands among the ``chosen``, more than it does as it is ``refined``; of any other, in the stead of some of them."""
    result: dict[int, Array] = {}
    groups = in_its_place(scores, chosen)
    if not groups and not any(scores.hypothesis(k).effect.sought for k in chosen):
        return result
    scales = Scales.of([piece.signals for piece in evidence.pieces], evidence.grid.band)
    for own in _sought(scores, scales):
        law = scores.owner[own[0]]
        for k in [k for k in chosen if k in own]:
            others = [c for c in chosen if c != k]
            gain, theta = _best(evidence, scores, scales, others, own)
            if scores.nats(others) + gain > refined.explained + _BETTER:
                result[k] = theta
        for gone in groups if law not in scores.owner[list(chosen)] else ():
            others = [k for k in chosen if k not in gone]
            whole, gains = scores.nats(chosen) - scores.nats(others), scores.gains(others)
            start = max(own, key=lambda k: gains[k])
            if gains[start] < _HOPELESS * whole:
                continue
            gain, theta = _best(evidence, scores, scales, others, own)
            if gain > max(float(gains[start]) + _BETTER, _LEAST * whole):
                result[start] = theta
    return result


def _sought(scores: Scores, scales: Scales) -> list[list[int]]:
    """The candidates of each law that is sought, those that have others about them."""
    result = []
    for number, law in enumerate(scores.design.hypotheses):
        if law.effect.sought:
            own = [int(k) for k in np.flatnonzero(scores.owner == number)]
            thetas = {k: scores.design.candidates[k].theta for k in own}
            result.append([k for k in own if len(law.effect.around(law.place, scales, thetas[k], _SHARES[0]))])
    return [own for own in result if own]


def _best(
    evidence: Evidence, scores: Scores, scales: Scales, others: Sequence[int], own: Sequence[int]
) -> tuple[float, Array]:
    """nats that the best shape about those of a law's candidates explains beside the others, and the shape itself."""
    gains, candidates = scores.gains(others), scores.design.candidates
    law = scores.hypothesis(own[0])
    starts = sorted(own, key=lambda k: gains[k])[-_STARTS:]
    best = [(float(gains[k]), candidates[k]) for k in starts]
    for share in _SHARES:
        near = [
            replace(form, theta=theta)
            for _, form in best
            for theta in law.effect.around(law.place, scales, form.theta, share)
            if now_and_then(evidence, law, theta)
        ]
        best = sorted([*best, *_with_gains(evidence, scores, others, near)], key=lambda one: one[0])[-_STARTS:]
    return best[-1][0], best[-1][1].theta


def _with_gains(
    evidence: Evidence, scores: Scores, others: Sequence[int], forms: Sequence[Candidate]
) -> list[tuple[float, Candidate]]:
    """nats that each of some forms explains beside the others, with the form."""
    if not forms:
        return []
    design = scores.design.with_candidates([*(scores.design.candidates[k] for k in others), *forms])
    block = total(sum_up(design, evidence.pieces, evidence.decimations, evidence.noise))
    beside = within_limits(Weighted(design, block, scores.weights), design.candidates[: len(others)], least=1)
    gains = beside.gains(groups_of(design, range(len(others), len(design.candidates))))
    return list(zip(map(float, gains[len(others) :]), forms, strict=True))
