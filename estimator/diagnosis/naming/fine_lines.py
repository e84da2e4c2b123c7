"""Lines of a spectrum above the orders at which laws are tried first.

Two a turn of a harmonic drive's wave generator are two hundred a turn of its joint, and a motor's slots pass as often.
Few of them are there, and to lay them all out beside every other law would cost more than all of these. Where a torque
has something left, its spectrum over the angle says which.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional, groups_of
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.gathered import Evidence, weighed_again
from estimator.diagnosis.evidence.grams import Block, sheets, sum_up, total
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.admission import FALSE_ALARM
from estimator.effects import Scales
from estimator.effects.waves import quadratures

Array = NDArray[np.float64]

_MOST = 6
"""Lines of one law at one joint."""
_MUCH = 0.2
"""Of a channel's noise."""


def with_fine_lines(evidence: Evidence, scores: Scores, refined: Refined) -> Evidence | None:
    """The evidence with candidates at the lines that stand out of what the ``refined`` causes leave, and beside each at
    its neighbours, between which it may be; and, where the coggings among those tell much of what recurs above the
    band, with the noise that is left of that. None where there is neither."""
    more = _more_lines(evidence, scores, refined)
    unseen = _without_coggings(evidence, refined)
    if not more and unseen is None:
        return None
    # Those of the grid stay together: orders as far from each other are made by products.
    design = evidence.design.with_candidates([*evidence.design.candidates, *more])
    if unseen is not None:
        return weighed_again(evidence, design, unseen, evidence.pieces, evidence.slow)
    made = sheets(design, evidence.pieces, evidence.decimations, evidence.noise, evidence.parts)
    return replace(evidence, design=design, blocks=tuple(sheet.compact() for sheet in made))


def _without_coggings(evidence: Evidence, refined: Refined) -> Array | None:
    """(channels, ORDER + 1) the errors that recur (`Evidence.unseen`), without what the coggings among the ``refined``
    causes are of them; None where that changes hardly any channel's noise."""
    design, known = refined.design, []
    for k, own in enumerate(design.candidates):
        law = design.hypotheses[own.hypothesis]
        if law.effect.name == "cogging" and law.place.joint is not None:
            known.append((law.place.joint, float(own.theta[0]), refined.coefficients(k)))
    if not evidence.noise.playings or not known:
        return None

    def ripple(q: Array) -> Array:
        torque = np.zeros_like(q)
        for joint, order, coefficients in known:
            torque[:, joint] += quadratures(order * q[:, joint]) @ coefficients
        return torque

    unseen = evidence.unseen.copy()
    unseen[:, 0] = np.minimum(evidence.unseen_without(ripple)[:, 0], unseen[:, 0])
    less = evidence.unseen[:, 0] - unseen[:, 0]
    return unseen if np.any(less > _MUCH * evidence.noise.rms**2) else None


def _more_lines(evidence: Evidence, scores: Scores, refined: Refined) -> list[Candidate]:
    design, scales = evidence.design, Scales.of([piece.signals for piece in evidence.pieces], evidence.grid.band)
    finer: dict[int, list[Candidate]] = {}
    for number in sorted(_left_over(evidence, scores, refined)):
        law, like = design.hypotheses[number], next(c for c in design.candidates if c.hypothesis == number)
        if law.effect.recurs and len(thetas := law.effect.finer(law.place, scales)):
            finer[number] = [replace(like, theta=theta) for theta in thetas]
    looked = sum(map(len, finer.values()))
    return [line for fine in finer.values() for line in _standing_out(evidence, scores, refined, fine, looked)]


def _left_over(evidence: Evidence, scores: Scores, refined: Refined) -> set[int]:
    """Hypotheses in whose channel something is left beyond what the noise is known to, or of whose noise much is only
    what recurs above the band; all where it is assumed."""
    left = refined.model.squares() / scores.total.rows - 1.0
    told = (left > scores.noise_error) | (evidence.unseen[:, 0] > _MUCH * evidence.noise.rms**2) | scores.assumed
    return {c.hypothesis for c in scores.design.candidates if np.any(told[list(c.channels)])}


def _standing_out(
    evidence: Evidence, scores: Scores, refined: Refined, fine: Sequence[Candidate], looked: int
) -> Iterator[Candidate]:
    """Of the ``fine`` lines of one law those that stand out of all of them, with their neighbours; of as many as were
    ``looked`` at, chance gives none."""
    chosen = refined.design.candidates
    wide = evidence.design.with_candidates([*chosen, *fine])
    lines = np.arange(len(chosen), len(wide.candidates))
    told = Weighted(wide, products(evidence, wide), scores.weights)
    found: list[int] = []
    while len(found) < _MOST:
        gains = gains_beside(wide, told, [*range(len(chosen)), *(len(chosen) + k for k in found)], lines)
        best = int(np.argmax(gains))
        # Half of what chance gives a line of two coefficients is below the logarithm of two.
        level = max(float(np.median(gains)) / np.log(2.0), 1.0)
        if gains[best] <= level * np.log(looked / FALSE_ALARM):
            break
        found.append(best)
    beside = {k + n for k in found for n in (-1, 0, 1)}
    known = [c.theta[0] for c in evidence.design.candidates if c.hypothesis == fine[0].hypothesis]
    yield from (
        fine[k] for k in sorted(beside) if 0 <= k < len(fine) and not np.any(np.isclose(fine[k].theta[0], known))
    )


def products(evidence: Evidence, design: Design) -> Block:
    """Of all columns of a ``design`` along the evidence's recordings, in the noise's standard deviations."""
    return total(sum_up(design, evidence.pieces, evidence.decimations, evidence.noise))


def gains_beside(design: Design, told: Weighted, chosen: Sequence[int], lines: NDArray[np.intp]) -> Array:
    """(lines,) nats that each would add to the given model with the chosen candidates."""
    columns = [design.candidates[k].columns for k in chosen]
    active = np.concatenate([np.arange(design.given), *columns]).astype(np.intp)
    return np.asarray(Conditional(told, active).gains(groups_of(design, lines))[lines])
