"""Plainer laws in the place of one that says, at its best shape, no more than they do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from itertools import permutations

import numpy as np

from estimator.diagnosis.evidence.forms import FORM, of_form
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.causes import Cause, judged
from estimator.diagnosis.naming.lack_of_fit import left_to_see
from estimator.diagnosis.naming.rivals import AMBIGUOUS, made_with, told_as
from estimator.diagnosis.naming.search import Search
from estimator.diagnosis.naming.sharpening import WORTH
from estimator.diagnosis.naming.unexplained import SIGNIFICANT
from estimator.effects import Law, catalogue

_MENDED = 0.1
"""Of what a law and those that it contains explain: with less beside those, and a shape hardly different from theirs,
it mends their form. Bristles of 20 to 200 µrad under a servo make up to 0.05 of a dry friction; the slow axes of a
KUKA, which show them, 0.2 and more."""


def told_once(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen without those that another one of their place contains, or makes without them, and that, at its best
    shape, it hardly needs beside itself: they mended the shape that it has on the grid. Beside a dry friction they are
    no more than a form of it where they explain less than any form is exact to; and so is a joint's delay beside the
    delay of all, which a filter that is no delay leaves at each."""
    search = Search(scores)
    for candidate in tuple(chosen):
        others = [k for k in chosen if k != candidate]
        of_all = [k for k in others if _of_all_joints(scores, candidate, k)]
        wider = of_all or [
            k for k in others if search.admission.contained(candidate, k) or candidate in made_with(scores, k, chosen)
        ]
        if not wider or (of_all and _more_than_mended(scores, candidate, of_all, others)):
            continue
        fewer = search.ordered(others)
        shaped = fitted(evidence, scores, fewer)
        least = WORTH
        if of_all:
            least = np.inf
        elif all(scores.hypothesis(k).effect.dry for k in wider):
            least = max(least, FORM * scores.nats_there(candidate, chosen))
        if of_form(refined.model, shaped.model) < least:
            chosen, refined = fewer, shaped
    return chosen, refined


def _of_all_joints(scores: Scores, candidate: int, other: int) -> bool:
    """Whether the other is of all joints what a candidate is of one, in whatever channel the two are compared."""
    own, law = (scores.hypothesis(k) for k in (candidate, other))
    alike = own.effect is law.effect and own.effect.equation_at(own.place) == law.effect.equation_at(law.place)
    return alike and own.place.joint is not None and law.place.joint is None


def _more_than_mended(scores: Scores, candidate: int, of_all: Sequence[int], others: Sequence[int]) -> bool:
    """Whether a joint's own law explains more beside that of all joints than mends its form at that joint."""
    channels = list(scores.design.candidates[candidate].channels)
    own = scores.explained([candidate], others)[channels].sum()
    both = scores.explained([candidate, *of_all], [k for k in others if k not in of_all])[channels].sum()
    return bool(own > _MENDED * both)


def simpler(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen with special cases in the place of a law that is, at its best shape, without what it is named for, or
    named for no part of its own: where they are as good at theirs, which a grid may not hold, and where the law is
    nothing but them. Of a law that bends to a form of its own they are as good but for what it leaves itself: it comes
    no nearer to the true one than they do."""
    search = Search(scores)
    for candidate in tuple(chosen):
        own = _as_named(refined, chosen.index(candidate)) if candidate in chosen else np.inf
        bends = bool(scores.hypothesis(candidate).effect.forms) and np.isfinite(own)
        special = search.specials.of(candidate, chosen) if own <= SIGNIFICANT or bends else []
        if not special:
            continue
        trial = search.ordered(search.pruned(special))
        shaped = fitted(evidence, scores, trial)
        inexact = _inexact(scores, chosen, candidate) if bends else 0.0
        if own == 0.0 or _support(scores, trial, shaped) > _support(scores, chosen, refined) - inexact:
            chosen, refined = trial, shaped
    return chosen, refined


def not_taken_back(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined
) -> tuple[list[int], Refined]:
    """The chosen with special cases in the place of a law and of another cause there that takes back what the law has
    beside them: each alone says nothing beside the special cases, and both together less of what is explained there
    than any form is exact to. Friction that is larger one way, with an offset the other way, is a form of friction at
    rest."""
    search = Search(scores)
    for wide, other in permutations(tuple(chosen), 2):
        place = scores.hypothesis(wide).place
        if not {wide, other} <= set(chosen) or scores.hypothesis(other).place != place:
            continue
        alone = [k for k in chosen if k != other]
        plain = [] if search.admission.contained(other, wide) else search.specials.of(wide, alone)
        if not plain or other in plain or max(map(scores.support, (alone, [*plain, other]))) > scores.support(plain):
            continue
        if of_form(scores.model(chosen), scores.model(plain)) < FORM * scores.nats_there(wide, chosen):
            chosen = search.ordered(plain)
            refined = fitted(evidence, scores, chosen)
    return chosen, refined


def without_menders(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined
) -> tuple[list[Cause], Refined]:
    """The causes as they are told, the rest of them as they stand: a law that only mends the form of what it contains
    (`Law.mends_below`) is told as that, with the alternatives that it had and those that have the plainer law's. A law
    that stands at two shapes mends its own form, and is told once."""
    search = Search(scores)
    once = [k for n, k in enumerate(chosen) if scores.recurs(k) or not _stands_before(scores, chosen[:n], k)]
    if once != chosen:
        chosen, refined = once, fitted(evidence, scores, once)
    causes = judged(search.admission, chosen)
    alternatives = {cause.candidate: cause.alternatives for cause in causes}
    for cause, own in zip(causes, refined.design.candidates, strict=True):
        below = scores.hypothesis(cause.candidate).effect.mends_below
        if not below:
            continue
        others = [k for k in chosen if k != cause.candidate]
        plainer = [k for k in others if _stands_for_the_same(search, k, cause.candidate)]
        instead = others if plainer else search.specials.of(cause.candidate, chosen)
        if not instead:
            continue
        shaped = fitted(evidence, scores, instead)
        explained = refined.explained - fitted(evidence, scores, [k for k in others if k not in plainer]).explained
        least = _MENDED if own.theta[0] < below else FORM
        if of_form(refined.model, shaped.model) < least * explained:
            for plain in set(instead) - set(others):
                alternatives[plain] = told_as(search.admission, cause.candidate, chosen, plain, cause.alternatives)
            # A wider law that stood in the plainer one's place may have been no more than a form of it either.
            for wide in plainer:
                trial = search.specials.of(wide, instead)
                if not trial:
                    continue
                fewer = fitted(evidence, scores, trial)
                if of_form(shaped.model, fewer.model) < max(WORTH, _inexact(scores, instead, wide)):
                    instead, shaped = trial, fewer
            chosen = search.ordered(instead)
            refined = fitted(evidence, scores, chosen)
    chosen, refined = _with_what_fell(evidence, search, chosen, refined)
    if (lines := _standing_out(search, chosen)) != chosen:
        chosen, refined = lines, fitted(evidence, scores, lines)
    return _agreed(scores, judged(search.admission, chosen, alternatives)), refined


def _with_what_fell(
    evidence: Evidence, search: Search, chosen: list[int], refined: Refined
) -> tuple[list[int], Refined]:
    """The causes with laws that wider ones have beside a dry friction, as they have a viscous one beside Coulomb's.
    Where bristles stood for the dry one, it was a trifle beside what they left, and is none once they are told as
    Coulomb's. Told where something is left to see without it."""
    scores = search.scores
    for cause in tuple(chosen):
        own = scores.hypothesis(cause)
        there = [h.effect for h in map(scores.hypothesis, chosen) if h.place == own.place]
        # What a law of bristles leaves, it leaves by its own form.
        if not own.effect.dry or any(effect.mends_below for effect in there):
            continue
        names = _told_beside(own.effect)
        ranked = [(scores.hypothesis(k), k, supported) for k, _, supported in scores.ranked(chosen)]
        for candidate in [k for h, k, s in ranked if h.place == own.place and h.effect.name in names and s > AMBIGUOUS]:
            trial = search.ordered([*chosen, candidate])
            if (
                _lacking(scores, chosen, candidate)
                and search.admission.admitted(candidate, chosen)
                and set(search.pruned(trial)) == set(trial)
            ):
                chosen, refined = trial, fitted(evidence, scores, trial)
    return chosen, refined


def _standing_out(search: Search, chosen: list[int]) -> list[int]:
    """The causes without lines that do not stand out of what is left of their spectrum, the least supported first. In
    a search they may stand for a law whose shape the grid does not hold, as a wall's."""
    while True:
        others = {k: [c for c in chosen if c != k] for k in chosen if search.scores.recurs(k)}
        hidden = [k for k in others if not search.admission.stands_out(k, others[k])]
        if not hidden:
            return chosen
        chosen = others[max(hidden, key=lambda k: search.scores.support(others[k]))]


def _lacking(scores: Scores, chosen: list[int], candidate: int) -> bool:
    """Whether what the chosen leave goes with something where a candidate acts."""
    return bool(np.any(left_to_see(scores, chosen)[list(scores.design.candidates[candidate].channels)] > 0.0))


def _told_beside(law: Law) -> set[str]:
    """The names of what laws that contain this one contain beside it."""
    wider = [effect for effect in catalogue().values() if law.name in effect.contains]
    return {name for effect in wider for name in effect.contains} - {law.name}


def _agreed(scores: Scores, causes: Sequence[Cause]) -> list[Cause]:
    """The causes with a law that could stand for two of a place as far behind the one as behind the other, where it is
    known what it usually has beside that (`Law.typical`): a rise from rest is one of a dry friction, and where that has
    none, the viscous one beside it has none. An offset beside a dry friction is what makes that larger one way."""
    behind = {
        (cause.candidate, int(scores.owner[other.candidate])): other.gap
        for cause in causes
        for other in cause.alternatives
    }
    result = []
    for cause in causes:
        own = scores.hypothesis(cause.candidate)
        there = [c.candidate for c in causes if scores.hypothesis(c.candidate).place == own.place]
        told = []
        for other in cause.alternatives:
            law, place = (h := scores.hypothesis(other.candidate)).effect, h.place
            usual = [k for k in there if scores.hypothesis(k).effect.name in law.typical]
            part = own.effect.name in {*law.contains, *law.made_with} - set(law.typical)
            if place == own.place and part and usual:
                other = replace(other, gap=behind.get((usual[0], int(scores.owner[other.candidate])), other.gap))
            told.append(other)
        result.append(replace(cause, alternatives=tuple(sorted(told, key=lambda one: one.gap))))
    return result


def _stands_for_the_same(search: Search, candidate: int, mender: int) -> bool:
    """Whether a law of the mender's place is, or contains, one that the mender contains."""
    own, other = (search.scores.hypothesis(k) for k in (candidate, mender))
    return own.place == other.place and bool({own.effect.name, *own.effect.contains} & set(other.effect.contains))


def _inexact(scores: Scores, chosen: list[int], candidate: int) -> float:
    """nats that the chosen leave to see where a candidate acts, up to what any form is exact to."""
    channels = list(scores.design.candidates[candidate].channels)
    left = left_to_see(scores, chosen)[channels] * scores.weights[channels]
    return min(0.5 * scores.total.rows * float(left.sum()), FORM * scores.nats_there(candidate, chosen))


def _stands_before(scores: Scores, before: Sequence[int], candidate: int) -> bool:
    return bool(np.any(scores.owner[list(before)] == scores.owner[candidate]))


def _support(scores: Scores, chosen: Sequence[int], refined: Refined) -> float:
    """nats that the chosen explain at their best shapes, less their penalty."""
    return refined.explained - scores.penalty(chosen)


def _as_named(refined: Refined, number: int) -> float:
    """Standard errors by which that differs from zero without which a cause would be another law, `SIGNIFICANT` where
    no part alone is that; zero where it is but a form of what it contains."""
    fitted = refined.design.candidates[number]
    effect = refined.design.hypotheses[fitted.hypothesis].effect
    named = list(effect.named_for)
    if not named:
        return SIGNIFICANT
    value = refined.coefficients(number)
    if not effect.differs(fitted.theta, value):
        return 0.0
    errors = np.sqrt(np.diag(refined.covariance_of(number)))[-len(value) :]
    return float(np.min(np.abs(value[named]) / errors[named]))
