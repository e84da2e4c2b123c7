"""A cause as it is told: its parameters, its share, what could stand in its stead."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.diagnosis.deciding.contest import Contest, contest
from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.accuracy import Searched
from estimator.diagnosis.naming.causes import Cause
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from estimator.diagnosis.telling.answer import Alternative, Finding, Quantity
from estimator.diagnosis.telling.quantities import quantities
from estimator.rigid_body import RigidBody

_SHOWN = 5
"""Alternatives that an answer lists."""


def finding(found: Searched, refined: Refined, number: int, cause: Cause, causes: Sequence[Cause]) -> Finding:
    """Of a cause, the one of this ``number`` among all ``causes``, with its alternatives."""
    evidence, scores = found.evidence, found.scores
    design = scores.design
    hypothesis = scores.hypothesis(cause.candidate)
    rivals = tuple(
        Alternative((h := scores.hypothesis(a.candidate)).effect.name, h.place, a.gap, a.decidable)
        for a in cause.alternatives
    )
    near = rivals[:_SHOWN]
    within = tuple(a for a in near if a.log_likelihood_gap < AMBIGUOUS)
    ambiguous = bool(within)
    fitted = refined.design.candidates[number]
    beside = [c.candidate for c in causes if c is not cause]
    open_to = [a.candidate for a in cause.alternatives[: len(within)] if a.decidable]
    return Finding(
        effect=hypothesis.effect.name,
        place=hypothesis.place,
        status="ambiguous" if ambiguous else "named",
        parameters=_against_the_model(
            quantities(
                hypothesis, design.body, fitted.theta, refined.coefficients(number), refined.covariance_of(number)
            ),
            hypothesis,
            found.links * (found.evidence.tolerance or 0.0),
        ),
        log_likelihood_gain=cause.gain,
        false_alarm_probability=cause.false_alarm,
        share_of_explainable=_share(scores, [c.candidate for c in causes], cause.candidate),
        alternatives=within or near,
        rivals=rivals,
        next_experiment=_experiment(hypothesis, design.body) if open_to else None,
        shape=fitted.theta[list(hypothesis.effect.hidden)] if hypothesis.effect.hidden else None,
        contest=_contest(evidence, scores, cause, beside, open_to) if open_to else None,
    )


def _against_the_model(told: dict[str, Quantity], hypothesis: Hypothesis, tolerance: float) -> dict[str, Quantity]:
    """The parameters with their errors, which count what the law's form is exact to (`Law.exact_to`); that of a delay
    of torques or angles counts that it is told by the slope of the model's torques, which is known as well as the links
    are."""
    effect, place = hypothesis.effect, hypothesis.place
    by_slope = effect.timed(place) is not None and effect.equation_at(place) == "torque"
    inexact = tolerance if by_slope else effect.exact_to
    if not inexact:
        return told
    return {
        name: replace(q, standard_error=np.hypot(q.standard_error, inexact * np.abs(q.value)))
        for name, q in told.items()
    }


def _share(scores: Scores, chosen: Sequence[int], own: int) -> float:
    """Of what all causes explain, and could, wherever this one acts, how much is lost when its own torque is left out.

    Everything else stays as it was fitted with it: links that may bend within their tolerance, or that are free, and
    other causes would take its place for a part, and a payload that rules everything would read a few percent.
    """
    model, given = scores.model(chosen), scores.design.given
    candidate = scores.design.candidates[own]
    channels = list(candidate.channels)
    others = ~np.isin(model.active, candidate.columns)
    nothing, without, whole = (
        model.squares_with(model.active[kept], model.value[kept])[channels].sum() / scores.total.rows
        for kept in (model.active < given, others, np.ones_like(others))
    )
    bound = max(nothing - min(whole, len(channels)), 1e-12)
    return float(np.clip((without - whole) / bound, 0.0, 1.0))


def _contest(
    evidence: Evidence, scores: Scores, cause: Cause, others: Sequence[int], alternatives: Sequence[int]
) -> Contest:
    """Of a cause with the nearest of its alternatives."""
    within = [cause.candidate, *alternatives]
    return contest(scores, evidence, others, [int(scores.owner[k]) for k in within])


def _experiment(hypothesis: Hypothesis, body: RigidBody) -> str:
    return hypothesis.effect.experiment_at(hypothesis.place, body)
