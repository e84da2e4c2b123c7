"""What could stand in a cause's stead, and how far behind it is."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from estimator.diagnosis.evidence.forms import FORM
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.typical import against_typical
from estimator.diagnosis.naming.admission import Admission

Array = NDArray[np.float64]

AMBIGUOUS = 3.0
"""nats within which an alternative is as good as the finding: its odds are better than one in twenty."""
_ONE_IN = 0.05
"""Probability that chance alone lets a wider law explain so much more than the one that it contains."""
_ALIKE = 1e-4
"""Of what a joint's causes explain: a friction that is other one way by a hundredth is not said to be other."""
_HARDLY_A_PERIOD = 0.25
"""Of a line's energy, what a straight law of the angle explains of it: 0.3 over one period, 0.1 over two."""


@dataclass(frozen=True)
class Alternative:
    """A candidate that could stand in for a cause, and how many nats behind it is."""

    candidate: int
    gap: float
    decidable: bool = True
    """Whether there are motions that tell it from the cause."""


def rivals(admission: Admission, candidate: int, chosen: list[int]) -> list[Alternative]:
    """Of a cause among all that were ``chosen``, nearest first.

    What a rival explains beside the cause as well, it does not explain in its stead. A freedom costs a nat here, what
    chance makes of it: that a law is simpler is no evidence that it is true, but between a law and one that contains
    it. The wider one is as good where chance would not explain so much more. One that contains other causes of the same
    place may stand for them too.
    """
    scores = admission.scores
    own, place = scores.owner[candidate], scores.hypothesis(candidate).place
    others = [c for c in chosen if c != candidate]
    beside = scores.gains(chosen)
    rows = scores.ranked(others)
    mine = next((row for row in rows if scores.owner[row[0]] == own), None)
    if mine is None:
        return []
    result = []
    for k, gain, supported in rows:
        if scores.owner[k] == own or admission.read_otherwise(k, others):
            continue
        shared = gain - _beside(scores, k, chosen, beside)
        if admission.contained(candidate, k) or admission.contained(k, candidate):
            theta = scores.design.candidates[candidate].theta
            untold = scores.assumed and scores.hypothesis(candidate).effect.told_by_repeats(theta)
            gap = 0.0 if untold else mine[2] - supported
        else:
            gap = mine[1] - scores.size(mine[0]) - (shared - scores.size(k))
            gap += _one_of_many(scores, k) if not scores.recurs(candidate) else 0.0
            law, theta = scores.hypothesis(candidate).effect, scores.design.candidates[candidate].theta
            if scores.hypothesis(k).place == place and not law.typical and law.seen_at(theta) != "temperature":
                # Of two forms that a plain law may have, and of a form and what goes with the temperature, the other
                # may be there besides, and yet not in its stead.
                usual = _against_usual(scores, candidate, chosen, k)
                gap = gap if usual is None else min(gap, max(usual, 0.0))
        if scores.hypothesis(k).place == place and any(admission.contained(c, k) for c in chosen):
            gap = _for_several(admission, candidate, k, chosen, gap)
        result.append(Alternative(k, gap))
    # A law that stands beside a line is bent as no law of its name is, or the line is.
    forms = {int(scores.owner[k]): k for k in others if _one_bent_law(scores, candidate, k)}
    told = [r for r in result if int(scores.owner[r.candidate]) not in forms]
    return sorted([*(Alternative(k, 0.0) for k in forms.values()), *told], key=lambda rival: rival.gap)


def _for_several(admission: Admission, candidate: int, rival: int, chosen: list[int], gap: float) -> float:
    """The gap of a rival that contains some of the chosen, and may stand for all of them, where it is ``gap`` against
    the one candidate."""
    scores, place = admission.scores, admission.scores.hypothesis(candidate).place
    instead = _instead(admission, rival, [c for c in chosen if c != candidate])
    whole = _with_all_parts(admission, rival, chosen)
    more = scores.nats(instead) - scores.nats(whole)
    freedom = sum(map(scores.size, instead)) - sum(map(scores.size, whole))
    gap += max(scores.support(whole) - scores.support(chosen), 0.0)
    if not admission.contained(candidate, rival) or made_with(scores, rival, chosen):
        return min(gap, freedom - more)
    # A law of which the motion shows a part alone may have no more freedom than those it contains.
    chance = AMBIGUOUS + 0.5 * float(chi2.isf(_ONE_IN, max(freedom, 1))) - more
    typical = _against_usual(scores, candidate, chosen, rival)
    bent = _shapes(scores, rival) > _shapes(scores, candidate)
    if typical is not None and (chance > AMBIGUOUS or _a_form(scores, candidate, chosen, instead, more, bent)):
        return typical
    # A rise from rest is one of a dry friction: where that is not there, a trifle of both is no evidence for either.
    there = {scores.hypothesis(k).effect.name for k in chosen if scores.hypothesis(k).place == place}
    usual = set(scores.hypothesis(rival).effect.typical)
    if usual and not usual & there and more < FORM * scores.nats_there(candidate, chosen):
        return max(gap, chance, AMBIGUOUS)
    # Of a wider law that is linear in what it has more, chance is known well.
    return chance if gap > 0.0 and not bent else min(gap, chance)


def told_as(
    admission: Admission, candidate: int, chosen: list[int], plain: int, alternatives: Sequence[Alternative]
) -> tuple[Alternative, ...]:
    """The ``alternatives`` of a cause that is told as a plainer law of its place, nearest first: those that contain the
    plainer law are as near as their usual form is, whether beside the cause as it was chosen or beside that law."""
    scores, result = admission.scores, []
    instead = [plain if c == candidate else c for c in chosen]
    for other in alternatives:
        if scores.owner[other.candidate] == scores.owner[plain]:
            continue
        usual = [
            _against_usual(scores, standing, there, other.candidate)
            for standing, there in ((candidate, chosen), (plain, instead))
            if admission.contained(plain, other.candidate)
        ]
        # What mends the form of either is refuted by the other.
        against = max((nats for nats in usual if nats is not None), default=other.gap)
        result.append(Alternative(other.candidate, max(min(against, other.gap), 0.0)))
    return tuple(sorted(result, key=lambda other: other.gap))


def _against_usual(scores: Scores, candidate: int, chosen: list[int], rival: int) -> float | None:
    """nats that speak against what a rival usually has beside the plainer law that a chosen candidate is, or
    contains."""
    law, wide = (scores.hypothesis(k).effect for k in (candidate, rival))
    alike = [scores.design.candidates[k] for k in np.flatnonzero(scores.owner == scores.owner[rival])]
    shapes = [candidate.columns for candidate in alike if wide.usual(candidate.theta)]
    return against_typical(scores.model(chosen), law, scores.design.candidates[candidate].columns, wide, shapes)


def _with_all_parts(admission: Admission, rival: int, chosen: list[int]) -> list[int]:
    """The chosen, and what the rival contains for which one of them stands: an asymmetric friction beside presliding
    has a Coulomb friction too, and what that explains there speaks for no asymmetry."""
    scores, place = admission.scores, admission.scores.hypothesis(rival).place
    there = [scores.hypothesis(c).effect for c in chosen if scores.hypothesis(c).place == place]
    stood_for = {name for law in there for name in law.contains} - {law.name for law in there}
    for own, hypothesis in enumerate(scores.design.hypotheses):
        name = hypothesis.effect.name
        if hypothesis.place == place and name in stood_for and name in scores.hypothesis(rival).effect.contains:
            forms = np.flatnonzero(scores.owner == own)
            chosen = [*chosen, int(forms[np.argmax(scores.gains(chosen)[forms])])]
    return chosen


def _one_bent_law(scores: Scores, one: int, other: int) -> bool:
    """Whether two causes of a joint may be a single law: of a periodic one hardly a period is seen, and it may look
    like the other."""
    if scores.hypothesis(one).place != scores.hypothesis(other).place or scores.recurs(one) == scores.recurs(other):
        return False
    line, law = (one, other) if scores.recurs(one) else (other, one)
    if scores.hypothesis(law).effect.name not in scores.hypothesis(line).effect.looks_like:
        return False
    return float(scores.resemblance(line, law).mean()) > _HARDLY_A_PERIOD


def _beside(scores: Scores, candidate: int, chosen: Sequence[int], gains: Array) -> float:
    """nats that a rival explains, of the same shape, beside all that were ``chosen``, what each does being in
    ``gains``; not at another shape, where chance alone lets some line of a law explain a few. One more line of a
    spectrum that is there bends the others: that is no merit of its own."""
    told = scores.owner[candidate] not in scores.owner[list(chosen)] and np.isfinite(gains[candidate])
    return max(float(gains[candidate]), 0.0) if told else 0.0


def _one_of_many(scores: Scores, candidate: int) -> float:
    """nats by which chance lets the best line of a law exceed any one of them; none of a law that has no lines. A line
    that was found has been asked for them."""
    return float(np.log(np.sum(scores.owner == scores.owner[candidate]))) if scores.recurs(candidate) else 0.0


def _shapes(scores: Scores, candidate: int) -> int:
    """Non-linear parameters of a form that are more than the sharpness of a sign."""
    return scores.size(candidate) - len(scores.design.candidates[candidate].columns)


def _instead(admission: Admission, candidate: int, others: list[int]) -> list[int]:
    """A law, at the shape that suits it best, beside those of the others that it neither contains nor is made with."""
    scores = admission.scores
    gone = {c for c in others if admission.contained(c, candidate)} | made_with(scores, candidate, others)
    left = [c for c in others if c not in gone]
    same = np.flatnonzero(scores.owner == scores.owner[candidate])
    gains = scores.gains(left)
    return [*left, max(map(int, same), key=lambda k: gains[k] - scores.penalty([k]))]


def _a_form(
    scores: Scores, candidate: int, chosen: Sequence[int], instead: Sequence[int], more: float, bent: bool
) -> bool:
    """Whether the nats ``more`` of a wider law, the last of those ``instead`` of the chosen, are no evidence for it:
    less than any form is exact to, where the law has a form of its own, or one more form of what it contains."""
    least = (FORM if bent else _ALIKE) * scores.nats_there(candidate, chosen)
    return more < least or not _differs(scores, instead)


def _differs(scores: Scores, chosen: Sequence[int]) -> bool:
    """Whether the last of the chosen is more beside the others than a form of what it contains."""
    model, own = scores.model(chosen), scores.design.candidates[chosen[-1]]
    coefficients = np.array([float(model.value[model.active == column].sum()) for column in own.columns])
    return scores.hypothesis(chosen[-1]).effect.differs(own.theta, coefficients)


def made_with(scores: Scores, candidate: int, chosen: Sequence[int]) -> set[int]:
    """Those of the chosen that a law in the same place makes much the same torque with, beside what it contains: it is
    no wider than both together."""
    own = scores.hypothesis(candidate)
    return {
        c for c in chosen if (h := scores.hypothesis(c)).place == own.place and h.effect.name in own.effect.made_with
    }
