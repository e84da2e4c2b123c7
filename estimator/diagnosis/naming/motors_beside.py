"""Transmissions seen from the link, with the motors whose inertia was found.

What an encoder on the link tells of a spring is the motor's inertia over its stiffness, and of a gap how a motor flies
across it. A URDF's bodies hold no rotors; where one is found beside them, it is the motor's.
"""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from estimator.effects import Place


@dataclass(frozen=True)
class _Motor:
    inertia: float
    """kg·m²"""
    variance: float


def with_motors_beside(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined
) -> tuple[list[int], Refined]:
    """The chosen, those of a transmission whose encoder is on the link with the inertia of its motor, where that is
    told beside the model's bodies and explains no less; its error is in theirs."""
    design, candidates, motors = evidence.design, list(evidence.design.candidates), dict[int, _Motor]()
    for number, k in enumerate(chosen):
        law, theta = scores.hypothesis(k), refined.design.candidates[number].theta
        if law.effect.with_motor(theta, 0.0) is None:
            continue
        if (motor := _motor_of(evidence, scores, chosen, refined, law.place)) is None:
            continue
        motors[number] = motor
        # With all shapes of its law that are seen from the link, between which it is refined.
        for other in (c for c, own in enumerate(candidates) if own.hypothesis == candidates[k].hypothesis):
            beside = law.effect.with_motor(theta if other == k else candidates[other].theta, motor.inertia)
            if beside is not None:
                candidates[other] = replace(candidates[other], theta=beside)
    if not motors:
        return chosen, refined
    shaped = fitted(replace(evidence, design=replace(design, candidates=tuple(candidates))), scores, chosen)
    # What has another shape with this motor than the recordings show has another one.
    if shaped.explained < refined.explained - AMBIGUOUS:
        return chosen, refined
    return chosen, _with_errors(shaped, motors)


def _motor_of(
    evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined, place: Place
) -> _Motor | None:
    """A joint's rotor; where its link is told as another one and a rotor would be as good, that."""

    def rotor_among(some: Sequence[int], fit: Refined) -> _Motor | None:
        for number, k in enumerate(some):
            if scores.hypothesis(k).effect.name == "rotor_inertia" and scores.hypothesis(k).place == place:
                return _Motor(float(fit.coefficients(number)[0]), float(fit.covariance_of(number)[-1, -1]))
        return None

    if (motor := rotor_among(chosen, refined)) is not None:
        return motor if motor.inertia > 0.0 else None
    link = [k for k in chosen if scores.hypothesis(k).effect.of_link and scores.hypothesis(k).place == place]
    rotors = [
        k
        for k, candidate in enumerate(scores.design.candidates)
        if (law := scores.design.hypotheses[candidate.hypothesis]).effect.name == "rotor_inertia" and law.place == place
    ]
    if not link or not rotors:
        return None
    instead = [*(k for k in chosen if k not in link), *rotors]
    if scores.support(instead) < scores.support(chosen) - AMBIGUOUS:
        return None
    return rotor_among(instead, fitted(evidence, scores, instead))


def _with_errors(refined: Refined, motors: Mapping[int, _Motor]) -> Refined:
    """With the errors of the motors' inertias in theta, and in the factors, which are as much smaller as a motor is
    larger."""
    covariance = refined.covariance.copy()
    before = refined.design.size
    for number, candidate in enumerate(refined.design.candidates):
        if number in motors:
            effect = refined.design.hypotheses[candidate.hypothesis].effect
            place = next(k for k in effect.hidden if candidate.theta[k] == motors[number].inertia)
            slope = np.zeros(len(covariance))
            slope[before + place] = 1.0
            slope[candidate.columns] = -refined.coefficients(number) / motors[number].inertia
            covariance += motors[number].variance * np.outer(slope, slope)
        before += len(candidate.theta)
    return replace(refined, covariance=covariance)
