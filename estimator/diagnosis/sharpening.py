"""The evidence once more, with the causes' laws at the shapes that fit best.

A search tries each law on a grid of its non-linear parameters. Beside small noise even a shape near the true one leaves
something, which then has other names or is told as unexplained.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.grams import sheets
from estimator.diagnosis.refinement import Refined
from estimator.diagnosis.scores import Scores

_WORTH = 10.0
"""nats that the refined shapes explain more than those of the grid: what is less has no name of its own."""


def sharpened(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """``evidence`` with the shapes of ``refined`` in the place of those of the ``chosen`` candidates, which ``scores``
    found; None where they explain hardly more."""
    model, design = refined.model, evidence.design
    explained = 0.5 * float(model.right[model.active] @ model.value)
    if explained < scores.support(chosen) + scores.penalty(chosen) + _WORTH:
        return None
    candidates = list(design.candidates)
    for k, fitted in zip(chosen, refined.design.candidates, strict=True):
        candidates[k] = replace(candidates[k], theta=fitted.theta)
    sharp = replace(design, candidates=tuple(candidates))
    rows = sheets(sharp, evidence.pieces, evidence.decimations, evidence.noise, evidence.parts)
    return replace(evidence, design=sharp, blocks=tuple(sheet.compact() for sheet in rows))
