"""Which causes are named: searched for, sharpened, and left out again where they explain nothing of their own."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np

from estimator.diagnosis.accuracy import Searched, searched
from estimator.diagnosis.answer import Finding
from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.findings import finding
from estimator.diagnosis.lack_of_fit import misfits
from estimator.diagnosis.left_noise import by_what_is_left
from estimator.diagnosis.quantities import quantities
from estimator.diagnosis.refinement import Refined, refine
from estimator.diagnosis.scores import Scores
from estimator.diagnosis.search import Cause, Search
from estimator.diagnosis.sharpening import WORTH, sharpened
from estimator.diagnosis.unexplained import SIGNIFICANT, VISIBLE

_NOTHING = 1.5
"""Standard errors by which a cause must differ from nothing once its shape was refined."""
_SHARPER = 2
"""Times that a search is made anew with sharper laws."""


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
    nameless: tuple[Finding, ...]
    """Laws at shapes that no thing of their name has: they stand for what has no name, and keep others from mending
    it."""
    named: Refined
    """With the candidates of the findings alone, as they were fitted beside those."""


def judge(evidence: Evidence) -> Judged:
    """Searches the evidence for causes. Where no repeats tell the noise, once more under the noise that they leave; and
    where their laws' shapes on the grid are not sharp enough, with those that fit best."""
    found = searched(evidence)
    if not evidence.noise.playings:
        evidence = by_what_is_left(evidence, found.scores, found.chosen)
        found = searched(evidence)
    causes, refined = _standing(found)
    for _ in range(_SHARPER):
        sharp = sharpened(evidence, found, causes, refined)
        if sharp is None:
            break
        stood = [cause.candidate for cause in causes]
        again = searched(sharp, replace(found, chosen=stood))
        # What stood, and explains even more with a sharper shape, does not fall by it.
        if again.scores.support(stood) > again.scores.support(again.chosen) + WORTH:
            break
        evidence, found = sharp, again
        causes, refined = _standing(found)
    scores, chosen = found.scores, tuple(cause.candidate for cause in causes)
    if found.widest is not scores:
        found.widest.reweigh(chosen)
    borne_out = None if found.links == 1.0 or evidence.tolerance is None else found.links * evidence.tolerance
    known = [_known(refined, number) for number in range(len(causes))]
    told = [finding(found, refined, number, cause, causes) for number, cause in enumerate(causes)]
    return Judged(
        found.evidence,
        scores,
        found.widest,
        borne_out,
        found.timings < 1.0,
        chosen,
        refined,
        findings=tuple(compress(told, known)),
        nameless=tuple(one for one, is_known in zip(told, known, strict=True) if not is_known),
        named=refined.only([number for number, is_known in enumerate(known) if is_known]),
    )


def _standing(found: Searched) -> tuple[list[Cause], Refined]:
    """The causes of a search that stand by their best shapes."""
    causes, refined = _refined(found.evidence, found.scores, _explaining(found.scores, found.widest, found.causes))
    causes, refined = _told_once(found.evidence, found.scores, causes, refined)
    return simpler(found.evidence, found.scores, causes, refined)


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
    within their own errors of it: what mended the shape of another cause is none beside its best one, and between two
    lines of a spectrum, one that the grid did not hold looks like a third."""
    kept = list(causes)
    while True:
        chosen = [cause.candidate for cause in kept]
        refined = fitted(evidence, scores, chosen)
        beyond = {
            k: _beyond_nothing(refined, number) / SIGNIFICANT
            if scores.recurs(k)
            else max(_beyond_nothing(refined, number), _told(refined, number)) / _NOTHING
            for number, k in enumerate(chosen)
        }
        least = min(beyond, key=lambda k: beyond[k], default=None)
        if least is None or beyond[least] > 1.0:
            return kept, refined
        kept = Search(scores).judged([k for k in chosen if k != least])


def _told_once(
    evidence: Evidence, scores: Scores, causes: list[Cause], refined: Refined
) -> tuple[list[Cause], Refined]:
    """The causes without those that another one of the same place contains and that, at its best shape, it hardly needs
    beside itself: they mended the shape that it has on the grid."""
    search = Search(scores)
    for cause in causes:
        others = [c.candidate for c in causes if c is not cause]
        if any(search.admission.contained(cause.candidate, k) for k in others):
            fewer = search.judged(others)
            shaped = fitted(evidence, scores, [c.candidate for c in fewer])
            if shaped.explained + WORTH > refined.explained:
                causes, refined = fewer, shaped
    return causes, refined


def simpler(evidence: Evidence, scores: Scores, causes: list[Cause], refined: Refined) -> tuple[list[Cause], Refined]:
    """The causes with special cases in the place of a law that is, at its best shape, without what it is named for:
    where they are as good at theirs, which a grid may not hold, and where the law is nothing but them."""
    search = Search(scores)
    for cause in causes:
        chosen = [c.candidate for c in causes]
        own = _as_named(refined, chosen.index(cause.candidate)) if cause.candidate in chosen else np.inf
        if own > SIGNIFICANT:
            continue
        trial = search.judged(search.pruned(search.special(cause.candidate, chosen)))
        shaped = fitted(evidence, scores, [c.candidate for c in trial])
        if trial and (own == 0.0 or _support(scores, trial, shaped) > _support(scores, causes, refined)):
            causes, refined = trial, shaped
    return causes, refined


def _known(refined: Refined, number: int) -> bool:
    """Whether things of a cause's name have its shape, or one within its error."""
    own = refined.design.candidates[number]
    errors = np.sqrt(np.diag(refined.covariance_of(number)))[: len(own.theta)]
    return refined.design.hypotheses[own.hypothesis].effect.known(own.theta - _NOTHING * errors)


def fitted(evidence: Evidence, scores: Scores, chosen: Sequence[int]) -> Refined:
    """The candidates at their best shapes, under the noise and the weights that they were chosen by."""
    return refine(evidence.design, chosen, evidence.pieces, evidence.decimations, evidence.noise, scores.weights)


def _support(scores: Scores, causes: Sequence[Cause], refined: Refined) -> float:
    """nats that the causes explain at their best shapes, less their penalty."""
    return refined.explained - scores.penalty([cause.candidate for cause in causes])


def _as_named(refined: Refined, number: int) -> float:
    """Standard errors by which that differs from zero without which a cause would be another law; zero where a part of
    it is not there, or too small a part of the whole."""
    fitted = refined.design.candidates[number]
    effect = refined.design.hypotheses[fitted.hypothesis].effect
    named = list(effect.named_for)
    if not named:
        return np.inf
    value = refined.coefficients(number)
    if np.any(np.abs(value[named]) < effect.least_part * abs(value[0])):
        return 0.0
    errors = np.sqrt(np.diag(refined.covariance_of(number)))[-len(value) :]
    return float(np.min(np.abs(value[named]) / errors[named]))


def _told(refined: Refined, number: int) -> float:
    """Standard errors by which a cause's first parameter differs from zero: of a spring a coefficient says nothing by
    itself, for it is the stiffness with its shape."""
    fitted = refined.design.candidates[number]
    hypothesis = refined.design.hypotheses[fitted.hypothesis]
    found = quantities(
        hypothesis, refined.design.body, fitted.theta, refined.coefficients(number), refined.covariance_of(number)
    )
    first = next(iter(found.values()))
    return float(np.max(np.abs(first.value) / np.maximum(first.standard_error, 1e-300)))


def _beyond_nothing(refined: Refined, number: int) -> float:
    """Standard errors by which all coefficients of a cause together differ from zero, its shape being free."""
    value = refined.coefficients(number)
    covariance = refined.covariance_of(number)[-len(value) :, -len(value) :]
    error = np.sqrt(np.diag(covariance))
    share = value / error
    return float(np.sqrt(share @ np.linalg.pinv(covariance / np.outer(error, error)) @ share))
