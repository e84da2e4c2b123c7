"""Causes: candidates that were chosen, with the evidence for them and what could stand in their stead."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, replace

from estimator.diagnosis.evidence.forms import read_apart
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.rivals import AMBIGUOUS, Alternative, rivals
from estimator.diagnosis.naming.special_cases import SpecialCases

_EXACT = 2e-4
"""Of what the laws of a place explain: the form of none is exact to less than a seventieth of its torque."""


@dataclass(frozen=True)
class Cause:
    """A candidate that was chosen, with its evidence given all others that were."""

    candidate: int
    gain: float
    """Log-likelihood that is lost without it."""
    false_alarm: float
    held_out: float
    """Log-likelihood gained on blocks left out, in standard errors."""
    alternatives: tuple[Alternative, ...] = ()

    def beside(self, other: Alternative, scores: Scores) -> Cause:
        """The cause with one more alternative that is as good, in the place of a farther one of its law."""
        same = [a for a in self.alternatives if scores.owner[a.candidate] == scores.owner[other.candidate]]
        if other.gap >= min((a.gap for a in same), default=AMBIGUOUS):
            return self
        told = [*(a for a in self.alternatives if a not in same), other]
        return replace(self, alternatives=tuple(sorted(told, key=lambda one: one.gap)))


def judged(
    admission: Admission, chosen: Sequence[int], alternatives: Mapping[int, tuple[Alternative, ...]] | None = None
) -> list[Cause]:
    """These candidates with their evidence beside each other; ``alternatives`` of those that are told already."""
    told = alternatives or {}
    return [_judged(admission, k, list(chosen), told.get(k)) for k in chosen]


def _judged(
    admission: Admission, candidate: int, chosen: list[int], alternatives: tuple[Alternative, ...] | None
) -> Cause:
    scores = admission.scores
    others = [c for c in chosen if c != candidate]
    own = int(scores.owner[candidate])
    best, gain = next(
        ((row[0], row[1]) for row in scores.ranked(others) if scores.owner[row[0]] == own), (candidate, 0.0)
    )
    false_alarm = scores.chance.false_alarm(best, gain)
    held_out = scores.held_out(candidate, others)
    if alternatives is None:
        # A rival that fits better and was not admitted is no better than the cause.
        near = [Alternative(r.candidate, max(r.gap, 0.0)) for r in rivals(admission, candidate, chosen)]
        near = _with_special(admission, candidate, chosen, near)
        alternatives = tuple(a for a in near if _named(scores, a.candidate))
    return Cause(candidate, gain, false_alarm, held_out, alternatives)


def _with_special(
    admission: Admission, candidate: int, chosen: list[int], near: list[Alternative]
) -> list[Alternative]:
    """The alternatives of a cause, nearest first: its special cases are as far behind as all of them together,
    beyond what the form of none of them is exact to, unless the drives tell them apart while they are off."""
    scores, special = admission.scores, SpecialCases(admission).of(candidate, chosen)
    if not special:
        return near
    read = read_apart(scores.model(chosen), scores.model(special))
    inexact = 0.0 if read else _EXACT * scores.nats_there(candidate, chosen)
    behind = max(scores.support(chosen) - scores.support(special) - inexact, 0.0)
    own = {int(scores.owner[k]): Alternative(k, behind) for k in special if k not in chosen}
    anew = (min(a, own.get(int(scores.owner[a.candidate]), a), key=lambda one: one.gap) for a in near)
    return sorted(anew, key=lambda one: one.gap)


def _named(scores: Scores, candidate: int) -> bool:
    """Whether things of its name have its shape."""
    return scores.hypothesis(candidate).effect.known(scores.design.candidates[candidate].theta)
