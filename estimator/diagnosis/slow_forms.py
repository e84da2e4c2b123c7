"""Slow periodic torques that only mend the form of another law of the angle."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.refinement import Refined, fitted
from estimator.diagnosis.scores import Scores
from estimator.diagnosis.sharpening import look_alikes
from estimator.diagnosis.unexplained import FORM

_PERIODS = 6.0
"""Over a joint's range; what is as slow may be the form of a spring, of which none is exact."""


def without_forms(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined
) -> tuple[list[int], Refined]:
    """The chosen without slow lines that explain less of what the laws of their joint's angle explain together than any
    form is exact to; beside them either form did, so that the better one alone is in the place of the larger."""
    for line in tuple(chosen):
        beside = [k for k in chosen if k != line and _of_the_angle(scores, line, k)] if line in chosen else []
        if not beside or _periods(evidence, scores, line) > _PERIODS:
            continue
        fewer = [k for k in chosen if k != line]
        shaped, others = fitted(evidence, scores, fewer), [k for k in fewer if k not in beside]
        whole = refined.explained - fitted(evidence, scores, others).explained
        if refined.explained - shaped.explained < FORM * whole:
            trials = [(shaped.explained - scores.penalty(fewer), fewer, shaped)]
            for trial in look_alikes(scores, fewer) if len(beside) == 1 else ():
                own = fitted(evidence, scores, trial)
                trials.append((own.explained - scores.penalty(trial), trial, own))
            _, chosen, refined = max(trials, key=lambda one: one[0])
    return chosen, refined


def _of_the_angle(scores: Scores, line: int, other: int) -> bool:
    """Whether another cause is a line of the same joint too, or what that may look like."""
    own, law = scores.hypothesis(line), scores.hypothesis(other)
    return own.place == law.place and law.effect.name in (own.effect.name, *own.effect.looks_like)


def _periods(evidence: Evidence, scores: Scores, line: int) -> float:
    """Of a line over its joint's range."""
    joint = scores.hypothesis(line).place.joint
    angles: Sequence[float] = [x for piece in evidence.pieces for x in _ends(piece.signals.q[:, joint])]
    return float(scores.design.candidates[line].theta[0]) * float(np.ptp(angles)) / (2.0 * np.pi)


def _ends(q: np.ndarray) -> tuple[float, float]:
    return float(q.min()), float(q.max())
