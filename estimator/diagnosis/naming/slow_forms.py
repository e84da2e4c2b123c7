"""Which law of a joint's angle it is, where the motion shows a part of it: a spring that bends, or a slow line."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np

from estimator.diagnosis.evidence.forms import FORM
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.causes import Cause
from estimator.diagnosis.naming.rivals import AMBIGUOUS, Alternative
from estimator.effects import Place

_PERIODS = 6.0
"""Over a joint's range; a faster line is the form of no spring."""
_APART = np.pi / 2.0
"""rad that two lines must come apart over a joint's range: half of what those of the grid do."""
_STARTS = 2
"""Pairs of lines on the grid, from which two lines are sought at their best shapes."""


def of_one_form(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen with one law in the place of all slow lines of a joint, and of what they look like, where one at its
    best shape explains what they do but for less than any form is exact to, or is as good, a nat being the cost of a
    freedom: three lines of a spectrum bend as a cylinder about its dead centre does.
    """
    for place in dict.fromkeys(scores.hypothesis(k).place for k in chosen if scores.recurs(k)):
        slow = [k for k in chosen if scores.hypothesis(k).place == place and _slow(evidence, scores, k, chosen)]
        if not any(scores.recurs(k) for k in slow):
            continue
        others = [k for k in chosen if k not in slow]
        alone = [[*others, k] for k in (*slow, *_instead(scores, place, slow, others))]
        trials = [(trial, fitted(evidence, scores, trial)) for trial in alone]
        best, shaped = max(trials, key=lambda one: worth(scores, *one))
        whole = refined.explained - fitted(evidence, scores, others).explained
        inexact = refined.explained - shaped.explained < FORM * whole
        if inexact or worth(scores, best, shaped) > worth(scores, chosen, refined):
            chosen, refined = best, shaped
    return chosen, refined


def worth(scores: Scores, chosen: list[int], refined: Refined) -> float:
    """nats that the chosen explain at their best shapes, less one for each freedom."""
    return refined.explained - sum(map(scores.size, chosen))


def look_alikes(evidence: Evidence, scores: Scores, chosen: list[int]) -> Iterator[tuple[list[int], Refined]]:
    """The chosen with another law in the place of one that it looks like (`Law.looks_like`), each at its best shape: of
    two laws neither is judged by how near the grid comes to it."""
    for cause in chosen:
        own, others = scores.hypothesis(cause), [k for k in chosen if k != cause]
        if not own.effect.looks_like or (scores.recurs(cause) and not _slow(evidence, scores, cause, chosen)):
            continue
        if scores.recurs(cause):
            trials = [[*others, k] for k in _instead(scores, own.place, [cause], others)]
        else:
            ranked = [(scores.hypothesis(k), k) for k, _, _ in scores.ranked(others)]
            like = [k for h, k in ranked if h.place == own.place and h.effect.name in own.effect.looks_like]
            trials = [[*others, k] for k in like]
        shaped = [(trial, fitted(evidence, scores, trial)) for trial in trials]
        if shaped:
            yield max(shaped, key=lambda one: worth(scores, *one))


@dataclass(frozen=True)
class _Pair:
    """Two slow lines in the place of others of the chosen, all at their best shapes."""

    chosen: list[int]
    """The lines last."""
    refined: Refined
    more: float
    """nats that they must explain more than what they stand for."""
    apart: bool
    """Whether they did not become one: such two are a polynomial of the angle, which bends as any law does."""


def of_two_lines(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen with two slow lines in the place of one, or more, and of a cause that they look like, or of a spring
    with all that they look like beside it, where two are better at their best shapes: one in the place of two that have
    hardly a period each takes a shape between theirs, and leaves an offset, a spring, or a wall; and both together are
    bent as a spring may be."""
    for cause in tuple(chosen):
        for law in _laws_of_lines(evidence, scores, cause, chosen) if cause in chosen else ():
            pair = _with_two(evidence, scores, law, cause, chosen)
            least = worth(scores, chosen, refined) + pair.more + AMBIGUOUS
            if pair.apart and worth(scores, pair.chosen, pair.refined) > least:
                chosen, refined = pair.chosen, pair.refined
                break
    return chosen, refined


def beside_two_lines(evidence: Evidence, scores: Scores, causes: Sequence[Cause], refined: Refined) -> Iterator[Cause]:
    """The causes, ``refined`` together, of which those that may be two lines (`of_two_lines`), alone or together, have
    them as an alternative, as far behind as they are."""
    chosen = [cause.candidate for cause in causes]
    pairs = [
        _with_two(evidence, scores, law, k, chosen)
        for k in chosen
        for law in _laws_of_lines(evidence, scores, k, chosen)
    ]
    for cause in causes:
        for pair in pairs:
            line = pair.chosen[-1]
            if cause.candidate not in pair.chosen and scores.owner[cause.candidate] != scores.owner[line]:
                behind = worth(scores, chosen, refined) + pair.more - worth(scores, pair.chosen, pair.refined)
                cause = cause.beside(Alternative(line, max(behind, 0.0)), scores)
        yield cause


def _laws_of_lines(evidence: Evidence, scores: Scores, cause: int, chosen: Sequence[int]) -> list[int]:
    """The hypotheses of the slow lines among the chosen that a cause looks like, of joints where it acts; where there
    are none, of those that its own place may have."""
    own, acts = scores.hypothesis(cause), scores.design.candidates[cause].channels
    name, alike = own.effect.name, {*own.effect.looks_like, *own.effect.confused_with}
    like = [k for k in chosen if scores.recurs(k) and name in scores.hypothesis(k).effect.looks_like]
    there = [k for k in like if set(scores.design.candidates[k].channels) <= set(acts)]
    slow = dict.fromkeys(int(scores.owner[k]) for k in there if _slow(evidence, scores, k, list(chosen)))
    instead = (
        number
        for number, law in enumerate(scores.design.hypotheses)
        if law.place == own.place and law.effect.recurs and law.effect.looks_like and law.effect.name in alike
    )
    return list(slow) or [law for law in instead if len(_slow_lines(evidence, scores, law)) > 1]


def _with_two(evidence: Evidence, scores: Scores, law: int, cause: int, chosen: Sequence[int]) -> _Pair:
    """Two slow lines of a law in the place of its own and of a cause; where it has none, in the place of all that they
    look like. Where none was found before, chance lets the best of all pairs exceed any one, and the form of what they
    stand for is no more exact than any."""
    others = [k for k in chosen if k != cause and scores.owner[k] != law]
    slow = _slow_lines(evidence, scores, law)
    found = any(scores.owner[k] == law for k in chosen)
    if not found:
        names, acts = scores.hypothesis(slow[0]).effect.looks_like, set(scores.design.candidates[slow[0]].channels)
        others = [
            k
            for k in others
            if scores.hypothesis(k).effect.name not in names or not acts <= set(scores.design.candidates[k].channels)
        ]
    trials = [[*others, *pair] for pair in combinations(slow, min(len(slow), 2))]
    best = [(trial, fitted(evidence, scores, trial)) for trial in sorted(trials, key=scores.nats)[-_STARTS:]]
    trial, shaped = max(best, key=lambda one: worth(scores, *one))
    if found:
        return _Pair(trial, shaped, 0.0, True)
    orders = [candidate.theta[0] for candidate in shaped.design.candidates[-2:]]
    apart = bool(np.ptp(orders) * reach(evidence, scores.hypothesis(slow[0]).place) > _APART)
    return _Pair(trial, shaped, max(float(np.log(len(trials))), FORM * scores.nats_there(cause, chosen)), apart)


def _slow_lines(evidence: Evidence, scores: Scores, law: int) -> list[int]:
    return [k for k in map(int, np.flatnonzero(scores.owner == law)) if _slow(evidence, scores, k, [])]


def _slow(evidence: Evidence, scores: Scores, cause: int, chosen: list[int]) -> bool:
    """Whether a cause is a line of a few periods, or a law that one looks like."""
    own = scores.hypothesis(cause)
    if not scores.recurs(cause):
        lines = [scores.hypothesis(k) for k in chosen if scores.recurs(k)]
        return any(line.place == own.place and own.effect.name in line.effect.looks_like for line in lines)
    if not own.effect.looks_like:
        return False
    return float(scores.design.candidates[cause].theta[0]) * reach(evidence, own.place) < 2.0 * np.pi * _PERIODS


def reach(evidence: Evidence, place: Place) -> float:
    """rad that a joint moves through."""
    ends = [end(piece.signals.q[:, place.joint]) for piece in evidence.pieces for end in (np.min, np.max)]
    return float(np.ptp(ends))


def _instead(scores: Scores, place: Place, slow: list[int], others: list[int]) -> Iterator[int]:
    """Candidates of what the slow lines of a place look like, the best beside all others for each choice of theirs and
    each centre of their grid, from which no steps along a slope lead to the next."""
    names = {name for k in slow if scores.recurs(k) for name in scores.hypothesis(k).effect.looks_like}
    gains, best = scores.gains(others), dict[tuple[int, bytes], int]()
    for k, candidate in enumerate(scores.design.candidates):
        law = scores.hypothesis(k)
        if law.place == place and law.effect.name in names and k not in slow:
            key = (
                candidate.hypothesis,
                candidate.theta[[*law.effect.choices, *range(len(candidate.theta))[-1:]]].tobytes(),
            )
            best[key] = max(best.get(key, k), k, key=lambda one: gains[one])
    yield from best.values()
