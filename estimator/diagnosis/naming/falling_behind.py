"""Friction that falls behind the speed, where a straight law of it leaves something.

A law that bends looks much like a dry friction, and where all is straight it would be a second name for one; so it is
tried at joints whose frictions were found and leave what it explains.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Candidate
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
    None where there are none."""
    fine = list(_to_try(evidence, refined))
    if not fine:
        return None
    least = 0.5 * _UNKNOWNS * np.log(scores.total.rows) + np.log(len(fine) / FALSE_ALARM)
    more = {fine[k].hypothesis for k in np.flatnonzero(_gains(evidence, scores, refined, fine) > least)}
    if not more:
        return None
    wide = evidence.design.with_candidates([*evidence.design.candidates, *(c for c in fine if c.hypothesis in more)])
    # How playings differ tells the noise, once what a friction makes of other motions is known.
    return weighed_again(evidence, wide, evidence.unseen, evidence.pieces, evidence.slow)


def _to_try(evidence: Evidence, refined: Refined) -> Iterator[Candidate]:
    """The bent candidates of laws that may bend, of joints that rub as their causes say."""
    design, scales = evidence.design, Scales.of([piece.signals for piece in evidence.pieces], evidence.grid.band)
    causes = [(refined.design.hypotheses[c.hypothesis], c.theta) for c in refined.design.candidates]
    rubbing = {law.place for law, theta in causes if law.effect.dry or law.effect.seen_at(theta) == "dq"}
    straight = {candidate.hypothesis: candidate for candidate in design.candidates}
    for number, like in straight.items():
        law = design.hypotheses[number]
        if law.place in rubbing and not law.effect.recurs:
            yield from (replace(like, theta=theta) for theta in law.effect.finer(law.place, scales))


def _gains(evidence: Evidence, scores: Scores, refined: Refined, fine: Sequence[Candidate]) -> Array:
    """(fine,) nats that each would add to the ``refined`` causes."""
    chosen = refined.design.candidates
    wide = evidence.design.with_candidates([*chosen, *fine])
    told = Weighted(wide, products(evidence, wide), scores.weights)
    return gains_beside(wide, told, range(len(chosen)), np.arange(len(chosen), len(wide.candidates)))
