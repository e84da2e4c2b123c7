"""Laws that go with all torque that a motor gives, by what the other causes were found to take of it.

A motor that gives less near zero, or towards its limit, or ripples, does so with its whole torque: that of the links,
and that of the friction, which of a joint whose weight hangs on its bearings is most of it. By the links' torque alone
such a law has another shape, and frictions of other kinds mend it.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.admission import FALSE_ALARM
from estimator.diagnosis.naming.bent_links import nats_changed
from estimator.diagnosis.naming.fine_lines import gains_beside, products
from estimator.diagnosis.observed.spending import Spent, spending
from estimator.diagnosis.observed.stretches import Stretch

Array = NDArray[np.float64]

_MOSTLY = 0.25
"""Of the energy of what motors were found to give beside the links' torque, what may have another size or form once a
law that goes with it is found."""
_WORTH = 3.0
"""nats that a cause must be expected to explain more with the whole torque."""


def with_motors_torque(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Evidence | None:
    """The evidence with the torque that motors give for the ``refined`` causes; None where that changes none of the
    chosen that go with it, and lets no other explain anything."""
    spent = tuple(spent_by(refined))
    if not spent:
        return None
    pieces = spending(evidence.pieces, spent)
    if not _matters(evidence, scores, list(chosen), refined, pieces):
        return None
    made = sheets(evidence.design, pieces, evidence.decimations, evidence.noise, evidence.parts)
    return replace(
        evidence,
        pieces=tuple(pieces),
        blocks=tuple(sheet.compact() for sheet in made),
        slow=cache(lambda: spending(evidence.slow(), spent)),
        spent=spent,
    )


def still_given(evidence: Evidence, refined: Refined) -> bool:
    """Whether motors still give most of the torque that causes were made of, for what stands beside these: a ripple of
    a friction is none without the friction, though it may be all of it."""
    laws = [refined.design.hypotheses[own.hypothesis] for own in refined.design.candidates]
    joints = {law.place.joint for law in laws if law.effect.of_motor and law.place.joint is not None}
    given, missing = np.zeros(evidence.design.body.n), np.zeros(evidence.design.body.n)
    for piece, now in zip(evidence.pieces, spending(evidence.pieces, tuple(spent_by(refined))), strict=True):
        before, after = (_beside(own) for own in (piece, now))
        given += np.sum(before**2, axis=0)
        missing += np.sum((after - before) ** 2, axis=0)
    return all(missing[joint] <= _MOSTLY * given[joint] for joint in joints)


def _beside(piece: Stretch) -> Array:
    told = piece.signals.tau_beside
    return np.zeros_like(piece.signals.q) if told is None else told


def spent_by(refined: Refined) -> Iterator[Spent]:
    """Of each cause that a motor gives torque for: not of what lies in its measurement."""
    for number, own in enumerate(refined.design.candidates):
        law = refined.design.hypotheses[own.hypothesis]
        if law.effect.spends(law.place):
            yield Spent(law.effect, law.place, own.theta, refined.coefficients(number))


def _matters(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined, pieces: Sequence[Stretch]
) -> bool:
    """Whether with their whole torque those that were chosen may explain more, or any other something."""
    design = evidence.design
    own = [k for k in chosen if scores.hypothesis(k).effect.of_motor]
    if any(nats_changed(evidence, scores, chosen, k, design.candidates[k], pieces) > _WORTH for k in own):
        return True
    taken = {scores.hypothesis(k).place for k in own}
    laws = {n: law for n, law in enumerate(design.hypotheses) if _alone(law) and law.place not in taken}
    open_to = [candidate for candidate in design.candidates if candidate.hypothesis in laws]
    if not open_to:
        return False
    wide = design.with_candidates([*refined.design.candidates, *open_to])
    known = len(refined.design.candidates)
    lines = np.arange(known, len(wide.candidates))
    before, after = (
        gains_beside(wide, Weighted(wide, products(one, wide), scores.weights), range(known), lines)
        for one in (evidence, replace(evidence, pieces=tuple(pieces)))
    )
    sizes = np.array([len(candidate.columns) for candidate in open_to])
    least = 0.5 * sizes * np.log(scores.total.rows) + np.log(len(open_to) / FALSE_ALARM)
    return bool(np.any((after > least) & (after > before + _WORTH)))


def _alone(law: Hypothesis) -> bool:
    """Whether a law goes with a motor's torque and is no line of a spectrum, of which there are hundreds."""
    return law.effect.of_motor and not law.effect.recurs
