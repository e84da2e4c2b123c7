"""Which causes are named: searched for, sharpened, and left out again where they explain nothing of their own."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import compress

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.forms import beside_forms
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.accuracy import Searched, searched
from estimator.diagnosis.naming.bent_links import with_bent_links
from estimator.diagnosis.naming.causes import Cause
from estimator.diagnosis.naming.falling_behind import with_bent_frictions
from estimator.diagnosis.naming.findings import finding
from estimator.diagnosis.naming.fine_lines import with_fine_lines
from estimator.diagnosis.naming.joint_or_arm import beside_joint_or_arm, of_joint_or_arm
from estimator.diagnosis.naming.lack_of_fit import misfits
from estimator.diagnosis.naming.late_torques import late_alike, with_late_torques
from estimator.diagnosis.naming.left_noise import by_what_is_left
from estimator.diagnosis.naming.motors_beside import with_motors_beside
from estimator.diagnosis.naming.motors_torque import still_given, with_motors_torque
from estimator.diagnosis.naming.one_line import of_one_line
from estimator.diagnosis.naming.plainer import not_taken_back, simpler, told_once, without_menders
from estimator.diagnosis.naming.restless import with_restless_frictions
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from estimator.diagnosis.naming.search import Search
from estimator.diagnosis.naming.shared import beside_shared
from estimator.diagnosis.naming.sharpening import WORTH, sharpened
from estimator.diagnosis.naming.slow_forms import beside_two_lines, of_one_form, of_two_lines
from estimator.diagnosis.naming.unexplained import SIGNIFICANT, VISIBLE
from estimator.diagnosis.telling.answer import Finding
from estimator.diagnosis.telling.quantities import quantities

Array = NDArray[np.float64]

_NOTHING = 3.0
"""Standard errors by which a cause must differ from nothing once its shape was refined, and is free: a wall that may be
anywhere, or a spring of any stiffness, imitates what has another name."""
_WITHIN = 1.5
"""Standard errors within which a cause has the shape of things of its name."""
_FORM_AT_MOST = 0.25
"""Of what is explained at a joint, what a law of a wrong form may leave: half of its torque."""
_FINER = 3
"""Times that lines above those of the grid are looked for: found, taken out of the noise, and found beside that."""
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
    """Candidates of the evidence's design that stand; they are told as ``findings``."""
    refined: Refined
    findings: tuple[Finding, ...]
    nameless: tuple[Finding, ...]
    """Laws at shapes that no thing of their name has: they stand for what has no name, and keep others from mending
    it."""
    named: Refined
    """With the candidates of the findings alone, as they were fitted beside those."""
    instead: tuple[tuple[int, ...], ...]
    """What stands, with an alternative that is as good in the place of a cause."""


def judge(evidence: Evidence) -> Judged:
    """Searches the evidence for causes. Where no repeats tell the noise, once more under the noise that they leave;
    where their laws go with torques that the given links do not have, with those that were fitted, and where they go
    with all that a motor gives, with what it gives for the others; where frictions leave what falls behind the speed,
    or are others in each recording, and torques what recurs with the angle, with these; where torques are late, with
    the motion that they answer to; and where their shapes on the grid are not sharp enough, with those that fit
    best."""
    evidence, found = _under_its_noise(evidence)
    stood, refined = _standing(found)
    if (other := with_bent_links(evidence, found.scores, stood, refined)) is not None:
        evidence, found = other, searched(other)
        stood, refined = _standing(found)
    if (other := with_bent_frictions(evidence, found.scores, refined)) is not None:
        evidence, found = _under_its_noise(other)
        stood, refined = _standing(found)
    for _ in range(_SHARPER):
        if (other := with_motors_torque(evidence, found.scores, stood, refined)) is None:
            break
        again = searched(other)
        standing = _standing(again)
        if not still_given(other, standing[1]):
            break
        evidence, found, (stood, refined) = other, again, standing
    evidence, found, stood, refined = _with_restless(evidence, found, stood, refined)
    for _ in range(_FINER):
        if (other := with_fine_lines(evidence, found.scores, refined)) is None:
            break
        evidence, found = other, searched(other)
        stood, refined = _standing(found)
    for _ in range(_SHARPER):
        if (other := with_late_torques(evidence, found.scores, stood, refined)) is None:
            break
        evidence, found = other, searched(other)
        stood, refined = _standing(found)
    # What was late may have looked like frictions that differ.
    evidence, found, stood, refined = _with_restless(evidence, found, stood, refined)
    for _ in range(_SHARPER):
        sharp = sharpened(evidence, found, stood, refined)
        if sharp is None:
            break
        evidence, found = sharp, _with_what_stood(searched(sharp, replace(found, chosen=stood)), stood)
        stood, refined = _standing(found)
    scores = found.scores
    borne_out = None if found.links == 1.0 or evidence.tolerance is None else found.links * evidence.tolerance
    told, named = without_menders(found.evidence, scores, stood, refined)
    seen = list(beside_two_lines(found.evidence, scores, told, named))
    seen = list(beside_joint_or_arm(found.evidence, scores, seen, named))
    seen = list(beside_shared(scores, seen, named))
    stood, refined = _beside_what_was_told(found.evidence, scores, stood, refined, [cause.candidate for cause in seen])
    if found.widest is not scores:
        found.widest.reweigh(stood)
    findings = [finding(found, named, number, cause, seen) for number, cause in enumerate(seen)]
    known = [
        _known(named, number) and (one.status == "ambiguous" or _shows_a_period(named, number))
        for number, one in enumerate(findings)
    ]
    return Judged(
        found.evidence,
        scores,
        found.widest,
        borne_out,
        found.timings < 1.0,
        tuple(stood),
        refined,
        findings=tuple(compress(findings, known)),
        nameless=tuple(one for one, is_known in zip(findings, known, strict=True) if not is_known),
        named=named.only([number for number, is_known in enumerate(known) if is_known]),
        instead=tuple(_instead(scores, stood, seen)),
    )


def _with_restless(
    evidence: Evidence, found: Searched, stood: list[int], refined: Refined
) -> tuple[Evidence, Searched, list[int], Refined]:
    """What is found and stands beside frictions that are others in each recording, where there are any."""
    other = with_restless_frictions(evidence, found.scores, stood, refined)
    if other is None:
        return evidence, found, stood, refined
    evidence, found = _under_its_noise(other)
    return evidence, found, *_standing(found)


def _under_its_noise(evidence: Evidence) -> tuple[Evidence, Searched]:
    """What a search finds; where no repeats tell the noise, once more under the noise that this leaves."""
    found = searched(evidence)
    if evidence.noise.playings:
        return evidence, found
    evidence = by_what_is_left(evidence, found.scores, found.chosen)
    return evidence, searched(evidence)


def _instead(scores: Scores, stood: Sequence[int], causes: Sequence[Cause]) -> Iterator[tuple[int, ...]]:
    """What ``stood``, with each alternative of each cause that is as good, in the place of that and of all that it
    contains."""
    contained = Search(scores).admission.contained
    for cause in causes:
        for other in (a.candidate for a in cause.alternatives if a.gap < AMBIGUOUS):
            left = [k for k in stood if k not in (cause.candidate, other) and not contained(k, other)]
            yield (*left, other)


def _with_what_stood(found: Searched, stood: list[int]) -> Searched:
    """What was found with sharper shapes, and beside it what stood before: where that explains even more with a sharper
    shape, it does not fall by it."""
    scores = found.scores
    if scores.support(stood) <= scores.support(found.chosen) + WORTH:
        return found
    own = {int(scores.owner[k]) for k in found.chosen}
    fallen = [k for k in stood if int(scores.owner[k]) not in own or scores.recurs(k)]
    return replace(found, chosen=Search(scores).pruned(list(dict.fromkeys([*found.chosen, *fallen]))))


def _standing(found: Searched) -> tuple[list[int], Refined]:
    """The candidates of a search that stand by their best shapes, in order."""
    evidence, scores = found.evidence, found.scores
    chosen, refined = _refined(evidence, scores, _explaining(scores, found.widest, found.chosen))
    chosen, refined = of_one_line(evidence, scores, chosen, refined)
    chosen, refined = told_once(evidence, scores, chosen, refined)
    chosen, refined = simpler(evidence, scores, chosen, refined)
    chosen, refined = late_alike(evidence, scores, chosen, refined)
    chosen, refined = not_taken_back(evidence, scores, chosen, refined)
    chosen, refined = of_one_form(evidence, scores, chosen, refined)
    chosen, refined = of_two_lines(evidence, scores, chosen, refined)
    chosen, refined = of_joint_or_arm(evidence, scores, chosen, refined)
    return with_motors_beside(evidence, scores, chosen, refined)


def _beside_what_was_told(
    evidence: Evidence, scores: Scores, stood: list[int], refined: Refined, told: Sequence[int]
) -> tuple[list[int], Refined]:
    """What stands, with causes that are told and that no law of their place contains, which stood in their stead."""
    search = Search(scores)
    more = [k for k in told if k not in stood and not any(search.admission.contained(k, own) for own in stood)]
    if not more:
        return stood, refined
    stood = search.ordered([*stood, *more])
    return stood, fitted(evidence, scores, stood)


def _explaining(scores: Scores, widest: Scores, chosen: list[int]) -> list[int]:
    """Without causes that leave more unexplained than they explain wherever they act: such a law only touches on the
    true one, and its name would mislead. All orders of a periodic law are judged as one."""
    left = np.maximum(scores.excess(beside_forms(scores, chosen)) - 1.0, 0.0)
    left[left < VISIBLE] = 0.0
    if widest is not scores:
        widest.reweigh(chosen)
    for channel, misfit in misfits(widest, beside_forms(widest, chosen)).items():
        if misfit.told:
            left[channel] = max(left[channel], misfit.variance)
    result = list(chosen)
    while result:
        more = {k: _more_than(left, scores, k, result) for k in result}
        least = min(more, key=lambda k: more[k])
        if more[least] > 0.0:
            break
        # One after the other: what two of a place explain together is what neither explains beside the other.
        result = [k for k in result if scores.owner[k] != scores.owner[least]]
    return result


def _more_than(left: Array, scores: Scores, candidate: int, chosen: Sequence[int]) -> float:
    """By how much of the noise's variance all recurrences of a cause explain more than what is ``left`` (channels,),
    where they do it best."""
    channels = list(scores.design.candidates[candidate].channels)
    own = [k for k in chosen if scores.owner[k] == scores.owner[candidate]]
    explained = scores.explained(own, [k for k in chosen if k not in own])
    return float(np.max(explained[channels] - left[channels]))


def _refined(evidence: Evidence, scores: Scores, chosen: Sequence[int]) -> tuple[list[int], Refined]:
    """The candidates at their best shapes, without those that are then nothing, and without recurrences of a law that
    are within their own errors of it: what mended the shape of another cause is none beside its best one, and between
    two lines of a spectrum, one that the grid did not hold looks like a third."""
    search = Search(scores)
    kept = search.ordered(chosen)
    refined = fitted(evidence, scores, kept)
    while True:
        beyond = {
            k: _beyond_nothing(refined, number) / SIGNIFICANT
            if scores.recurs(k)
            else max(_beyond_nothing(refined, number), _told(refined, number)) / _NOTHING
            for number, k in enumerate(kept)
        }
        nothing = sorted((k for k in kept if beyond[k] <= 1.0), key=lambda k: beyond[k])
        fewer = ((least, search.ordered([k for k in kept if k != least])) for least in nothing)
        trials = ((least, trial, fitted(evidence, scores, trial)) for least, trial in fewer)
        # Of two slow lines that may have one shape neither is sure of itself; yet both are there if one leaves much.
        without = (one[1:] for one in trials if not _needed(scores, one[0], kept, refined, one[2]))
        trial = next(without, None)
        if trial is None:
            return kept, refined
        kept, refined = trial


def _needed(scores: Scores, candidate: int, chosen: Sequence[int], refined: Refined, without: Refined) -> bool:
    """Whether what is left ``without`` a cause is seen beside the noise, and is more than any form of another hides."""
    seen = np.any(without.model.squares() - refined.model.squares() > VISIBLE * scores.total.rows)
    hidden = _FORM_AT_MOST * scores.nats_there(candidate, list(chosen))
    return bool(seen) and refined.explained - without.explained > hidden


def _known(refined: Refined, number: int) -> bool:
    """Whether things of a cause's name have its shape, or one within its error."""
    own = refined.design.candidates[number]
    errors = np.sqrt(np.diag(refined.covariance_of(number)))[: len(own.theta)]
    return refined.design.hypotheses[own.hypothesis].effect.known(own.theta - _WITHIN * errors)


def _shows_a_period(refined: Refined, number: int) -> bool:
    """Whether a cause is no line alone whose order may be none. Of several that are near to each other none is sure of
    its own; together they are."""
    own = refined.design.candidates[number]
    lines = [one for one in refined.design.candidates if one.hypothesis == own.hypothesis]
    if len(lines) > 1 or not refined.design.hypotheses[own.hypothesis].effect.recurs:
        return True
    return bool(own.theta[0] > _WITHIN * np.sqrt(refined.covariance_of(number)[0, 0]))


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
