"""Friction that falls behind the speed, where a straight law of it leaves something.

A law that bends looks much like a dry friction, and where all is straight it would be a second name for one; so it is
tried at joints whose frictions were found and leave what it explains.
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Candidate, Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence, weighed_again
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.admission import FALSE_ALARM
from estimator.diagnosis.naming.fine_lines import gains_beside, products
from estimator.effects import Scales

Array = NDArray[np.float64]

_UNKNOWNS = 3
"""A slope, and a bend with its sharpness."""


def with_bent_frictions(evidence: Evidence, scores: Scores, refined: Refined) -> Evidence | None:
    """The evidence with bent frictions of the joints where one explains something that the ``refined`` causes leave;
    None where there are none, or where they are tried already."""
    design = evidence.design
    more = [
        candidate
        for number, fine in _to_try(evidence, refined)
        if _explains(evidence, scores, refined, fine) and not _tried(evidence, number, fine)
        for candidate in fine
    ]
    if not more:
        return None
    wide = design.with_candidates([*design.candidates, *more])
    # How playings differ tells the noise, once what a friction makes of other motions is known.
    return weighed_again(evidence, wide, evidence.unseen, evidence.pieces, evidence.slow)


def _to_try(evidence: Evidence, refined: Refined) -> Iterator[tuple[int, list[Candidate]]]:
    """The hypotheses whose laws may bend, of joints that rub as their causes say, each with its bent candidates."""
    design, scales = evidence.design, Scales.of([piece.signals for piece in evidence.pieces], evidence.grid.band)
    causes = [(refined.design.hypotheses[c.hypothesis], c.theta) for c in refined.design.candidates]
    rubbing = {law.place for law, theta in causes if _rubs(law, theta)}
    for number, law in enumerate(design.hypotheses):
        if law.effect.recurs or law.place not in rubbing:
            continue
        like = next((c for c in design.candidates if c.hypothesis == number), None)
        thetas = law.effect.finer(law.place, scales)
        if like is not None and len(thetas):
            yield number, [replace(like, theta=theta) for theta in thetas]


def _rubs(law: Hypothesis, theta: Array) -> bool:
    return law.effect.dry or law.effect.seen_at(theta) == "dq"


def _tried(evidence: Evidence, number: int, fine: list[Candidate]) -> bool:
    return any(c.hypothesis == number and np.array_equal(c.theta, fine[0].theta) for c in evidence.design.candidates)


def _explains(evidence: Evidence, scores: Scores, refined: Refined, fine: list[Candidate]) -> bool:
    """Whether one of them explains more beside the ``refined`` causes than chance and its unknowns would."""
    chosen = refined.design.candidates
    wide = evidence.design.with_candidates([*chosen, *fine])
    told = Weighted(wide, products(evidence, wide), scores.weights)
    lines = np.arange(len(chosen), len(wide.candidates))
    gain = float(gains_beside(wide, told, list(range(len(chosen))), lines).max())
    return bool(gain > 0.5 * _UNKNOWNS * np.log(scores.total.rows) + np.log(len(fine) / FALSE_ALARM))
