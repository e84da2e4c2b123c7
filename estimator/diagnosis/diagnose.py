"""The whole way from recordings and the given model to named causes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.accuracy import searched
from estimator.diagnosis.answer import Alternative, Diagnosis, Finding, HeldOut, Residual, Unexplained, Verdict
from estimator.diagnosis.contest import Contest, contest
from estimator.diagnosis.design import Hypothesis
from estimator.diagnosis.detectable import smallest_detectable
from estimator.diagnosis.evidence import Evidence, cut, gather
from estimator.diagnosis.first_body import has_bodies
from estimator.diagnosis.grams import sum_up, total
from estimator.diagnosis.lack_of_fit import misfits
from estimator.diagnosis.left_noise import by_what_is_left
from estimator.diagnosis.noise import Noise
from estimator.diagnosis.quantities import quantities
from estimator.diagnosis.refinement import Refined, refine
from estimator.diagnosis.scores import Scores
from estimator.diagnosis.search import AMBIGUOUS, Cause, Search
from estimator.diagnosis.sharpening import sharpened
from estimator.diagnosis.torques import (
    left_out_power,
    plain_blocks,
    residual_power,
    share_of_explainable,
    torque_channels,
)
from estimator.diagnosis.traces import Traces, traces
from estimator.diagnosis.unexplained import SIGNIFICANT, VISIBLE, unexplained_by
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_SHOWN = 5
"""Alternatives that an answer lists."""
_NOTHING = 1.0
"""Standard errors by which a cause's coefficients must differ from zero once its shape was refined."""
_SHARPER = 2
"""Times that a search is made anew with sharper laws."""
_WORTH_TELLING = 0.12
"""Of the explainable: a smaller share that is left does not make the verdict unknown."""


def diagnose(
    body: RigidBody,
    trajectories: Sequence[Trajectory],
    hold_out: Sequence[Trajectory] = (),
    tolerance: float = 0.05,
) -> Diagnosis:
    """Names what the given model gets wrong.

    ``tolerance``: relative standard deviation to which the model's inertial parameters are believed. ``hold_out``:
    recordings on which the gain is measured; without them, data left out in turn.
    Raises InputError for recordings that cannot be judged.
    """
    judged = judge(gather(body, trajectories, tolerance))
    evidence, scores, refined, findings = judged.evidence, judged.scores, judged.refined, judged.findings
    chosen = list(judged.chosen)
    given, body = body, evidence.design.body
    unexplained = unexplained_by(evidence, judged.widest, refined, chosen)
    sizes, units = smallest_detectable(scores, chosen)
    return Diagnosis(
        joints=body.joints,
        verdict=verdict(findings, unexplained),
        findings=findings,
        unexplained=unexplained,
        torque_residual=_residuals(evidence, refined),
        held_out=_held_out(evidence, scores, refined, body, hold_out),
        smallest_detectable=sizes,
        detectable_units=units,
        notes=tuple(_notes(evidence, given, tolerance, judged)),
        traces=_traces(evidence, refined, body, hold_out),
        band=evidence.grid.band,
        base_deviation=_deviation(evidence, refined, given),
    )


@dataclass(frozen=True)
class Judged:
    """Evidence with the causes that it names."""

    evidence: Evidence
    """Under the noise that they were judged by."""
    scores: Scores
    widest: Scores
    """As wide as the given model's tolerance, where the links are known better (`accuracy`)."""
    borne_out: float | None
    """The tolerance that the recordings bear out, where it is tighter than the given one."""
    punctual: bool
    """Whether the channels' timings are borne out better than they are believed at first."""
    chosen: tuple[int, ...]
    """Candidates of the evidence's design."""
    refined: Refined
    findings: tuple[Finding, ...]
    """One a candidate, likewise."""


def judge(evidence: Evidence) -> Judged:
    """Searches the evidence for causes. Where no repeats tell the noise, once more under the noise that they leave; and
    where their laws' shapes on the grid are not sharp enough, with those that fit best."""
    found = searched(evidence)
    if not evidence.noise.playings:
        evidence = by_what_is_left(evidence, found.scores, found.chosen)
        found = searched(evidence)
    for _ in range(_SHARPER):
        scores = found.scores
        causes, refined = _refined(found.evidence, scores, _explaining(scores, found.widest, found.causes))
        sharp = sharpened(evidence, scores, [cause.candidate for cause in causes], refined)
        if sharp is None:
            break
        evidence, found = sharp, searched(sharp)
    evidence, scores = found.evidence, found.scores
    causes, refined = _refined(evidence, scores, _explaining(scores, found.widest, found.causes))
    chosen = tuple(cause.candidate for cause in causes)
    if found.widest is not scores:
        found.widest.reweigh(chosen)
    findings = tuple(_finding(evidence, scores, refined, number, cause, causes) for number, cause in enumerate(causes))
    return Judged(evidence, scores, found.widest, found.borne_out, found.punctual, chosen, refined, findings)


def _explaining(scores: Scores, widest: Scores, causes: Sequence[Cause]) -> list[Cause]:
    """Without causes that leave more unexplained than they explain wherever they act: such a law only touches on the
    true one, and its name would mislead. All orders of a periodic law are judged as one."""
    chosen = [cause.candidate for cause in causes]
    left = np.maximum(scores.excess(chosen) - 1.0, 0.0)
    left[left < VISIBLE] = 0.0
    if widest is not scores:
        widest.reweigh(chosen)
    for channel, misfit in misfits(widest, chosen).items():
        if misfit.told:
            left[channel] = max(left[channel], misfit.variance)
    result = []
    for cause in causes:
        channels = list(scores.design.candidates[cause.candidate].channels)
        own = [k for k in chosen if scores.owner[k] == scores.owner[cause.candidate]]
        explained = scores.explained(own, [k for k in chosen if k not in own])
        if np.any(explained[channels] > left[channels]):
            result.append(cause)
    return result


def _refined(evidence: Evidence, scores: Scores, causes: Sequence[Cause]) -> tuple[list[Cause], Refined]:
    """The causes at their best shapes, without those that are then nothing, and without recurrences of a law that are
    within their own errors of it: between two lines of a spectrum, one that the grid did not hold looks like a third,
    and the lateness of one joint mends that of all."""
    kept = list(causes)
    while True:
        chosen = [cause.candidate for cause in kept]
        refined = refine(evidence.design, chosen, evidence.pieces, evidence.decimations, evidence.noise, scores.weights)
        beyond = {
            k: _beyond_nothing(refined, number) / (SIGNIFICANT if scores.recurs(k) else _NOTHING)
            for number, k in enumerate(chosen)
        }
        least = min(beyond, key=lambda k: beyond[k], default=None)
        if least is None or beyond[least] > 1.0:
            return kept, refined
        kept = Search(scores).judged([k for k in chosen if k != least])


def _beyond_nothing(refined: Refined, number: int) -> float:
    """Standard errors by which all coefficients of a cause together differ from zero, its shape being free."""
    value = refined.coefficients(number)
    covariance = refined.covariance_of(number)[-len(value) :, -len(value) :]
    error = np.sqrt(np.diag(covariance))
    share = value / error
    return float(np.sqrt(share @ np.linalg.pinv(covariance / np.outer(error, error)) @ share))


def _finding(
    evidence: Evidence, scores: Scores, refined: Refined, number: int, cause: Cause, causes: Sequence[Cause]
) -> Finding:
    design = scores.design
    hypothesis = scores.hypothesis(cause.candidate)
    rivals = tuple(
        Alternative((h := scores.hypothesis(a.candidate)).effect.name, h.place, a.gap) for a in cause.alternatives
    )
    near = rivals[:_SHOWN]
    within = tuple(a for a in near if a.log_likelihood_gap < AMBIGUOUS)
    ambiguous = bool(within)
    fitted = refined.design.candidates[number]
    beside = [c.candidate for c in causes if c is not cause]
    return Finding(
        effect=hypothesis.effect.name,
        place=hypothesis.place,
        status="ambiguous" if ambiguous else "named",
        parameters=quantities(
            hypothesis, design.body, fitted.theta, refined.coefficients(number), refined.covariance_of(number)
        ),
        log_likelihood_gain=cause.gain,
        false_alarm_probability=cause.false_alarm,
        share_of_explainable=_share(scores, [c.candidate for c in causes], cause.candidate),
        alternatives=within or near,
        rivals=rivals,
        next_experiment=_experiment(hypothesis, design.body) if ambiguous else None,
        shape=fitted.theta[list(hypothesis.effect.hidden)] if hypothesis.effect.hidden else None,
        contest=_contest(evidence, scores, cause, beside, len(within)) if ambiguous else None,
    )


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


def _contest(evidence: Evidence, scores: Scores, cause: Cause, others: Sequence[int], count: int) -> Contest:
    """Of a cause with the ``count`` nearest of its alternatives."""
    within = [cause.candidate, *(a.candidate for a in cause.alternatives[:count])]
    return contest(scores, evidence, others, [int(scores.owner[k]) for k in within])


def _experiment(hypothesis: Hypothesis, body: RigidBody) -> str:
    return hypothesis.effect.experiment_at(hypothesis.place, body)


def verdict(findings: Sequence[Finding], unexplained: dict[int, Unexplained]) -> Verdict:
    """Of findings and of what no finding explains, by joint."""
    if any(left.share > _WORTH_TELLING for left in unexplained.values()):
        return "unknown"
    if not findings:
        return "clean"
    return "ambiguous" if any(finding.status == "ambiguous" for finding in findings) else "named"


def _residuals(evidence: Evidence, refined: Refined) -> tuple[Residual, ...]:
    design = refined.design
    whole = total(plain_blocks(design, evidence.pieces, evidence.decimations))
    before = np.sqrt(residual_power(design, whole, np.zeros(design.size)))
    after = np.sqrt(residual_power(design, whole, refined.value))
    return tuple(
        Residual(float(before[k]), float(after[k]), float(evidence.noise.likely[k]), axis.torque_unit)
        for k, axis in zip(torque_channels(design), design.body.axes, strict=True)
    )


def _held_out(
    evidence: Evidence, scores: Scores, refined: Refined, body: RigidBody, hold_out: Sequence[Trajectory]
) -> HeldOut:
    design = refined.design
    chosen = torque_channels(design)
    if hold_out:
        pieces = cut(body, evidence.grid, hold_out)
        whole = total(plain_blocks(design, pieces, [evidence.grid.decimation(p.signals.period) for p in pieces]))
        before, after = (
            residual_power(design, whole, np.zeros(design.size)),
            residual_power(design, whole, refined.value),
        )
    else:
        plain = plain_blocks(design, evidence.pieces, evidence.decimations, evidence.parts)
        whitened = sum_up(design, evidence.pieces, evidence.decimations, evidence.noise, evidence.parts)
        whole = total(plain)
        before = residual_power(design, whole, np.zeros(design.size))
        after = left_out_power(design, scores.weights, whitened, plain, evidence.folds)
    variance = evidence.noise.likely[chosen] ** 2
    freedom = evidence.noise.degrees_of_freedom or np.inf
    least = SIGNIFICANT * np.sqrt((2.0 / whole.rows + 2.0 / freedom) * len(chosen))
    return HeldOut(
        before=float(np.sqrt(np.mean(before[chosen]))),
        after=float(np.sqrt(np.mean(after[chosen]))),
        share_of_explainable=share_of_explainable(before[chosen] / variance, after[chosen] / variance, float(least)),
    )


def _traces(evidence: Evidence, refined: Refined, body: RigidBody, hold_out: Sequence[Trajectory]) -> Traces:
    """Shown on what was held out where there is some."""
    shown = cut(body, evidence.grid, hold_out) if hold_out else evidence.pieces
    return traces(refined, evidence.pieces, shown, evidence.grid, evidence.noise.likely, body.joints)


def _deviation(evidence: Evidence, refined: Refined, given: RigidBody) -> Array:
    """(rank,) of the base parameters from those of the model that was given."""
    base = evidence.design.base
    first = base.combination @ (evidence.design.body.prior() - given.prior())
    return np.asarray(first + refined.value[: base.rank])


def _notes(evidence: Evidence, given: RigidBody, tolerance: float, judged: Judged) -> list[str]:
    notes = []
    off = sorted(f.place.joint for f in judged.findings if f.effect == "link_inertia" and f.place.joint is not None)
    if len(off) > 1:
        notes.append(
            f"the links of {', '.join(given.joints[k] for k in off)} are all off by more than the tolerance of "
            f"{100.0 * tolerance:.2g} %: make sure that the model is this arm's, and its links known so well"
        )
    if judged.borne_out is not None:
        notes.append(
            f"the links fit these recordings to {100.0 * judged.borne_out:.2g} %, where the tolerance is "
            f"{100.0 * tolerance:.2g} %: causes are judged by links that are as exact as that"
        )
    late = any(finding.effect == "transport_delay" for finding in judged.findings)
    if judged.punctual and late:
        notes.append(
            "the other channels of these recordings are in time to a small part of a sample: what is late is judged by "
            "that"
        )
    if not has_bodies(given):
        notes.append(
            "the model has no masses: its links are those that fit these recordings, and no cause is sought there"
        )
    noise: Noise = evidence.noise
    if noise.playings:
        notes.append(f"noise from {noise.playings} playings of {len(evidence.repeats)} repeated motions")
    else:
        notes.append(
            "no motion was played twice: the noise is assumed, and may be as large as all that is left; "
            "play each motion twice to see smaller effects"
        )
    return notes
