"""Laws of one joint's angle against laws of the whole arm that one joint shows: a wall that the tool presses into may
look like a bent spring, or like slow lines; a spring about an upright axis like a tilted base.

A search tries walls by twenty-six directions and three depths each, and springs by a few bends and centres: which comes
first is a matter of whose grid comes nearer. Here both are at their best shapes.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.causes import Cause
from estimator.diagnosis.naming.rivals import AMBIGUOUS, Alternative
from estimator.diagnosis.naming.slow_forms import worth
from estimator.effects import Place

Array = NDArray[np.float64]

_STARTS = 4
"""Candidates from which the best shape is sought."""
_MOST_OF_THE_TIME = 0.9
"""Of all samples, that a law acts in which comes and goes."""
_HOPELESS = 0.4
"""Of what causes explain, the least that a candidate explains in their stead on the grid."""


def of_joint_or_arm(
    evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined
) -> tuple[list[int], Refined]:
    """The chosen with a law of the whole arm in the place of those of single joints that look like it, or the other way
    round, where it is better, all at their best shapes."""
    for gone in in_its_place(scores, chosen):
        if not set(gone) <= set(chosen):
            continue
        tried = _with_another(evidence, scores, gone, chosen, anew=True)
        if tried is not None and worth(scores, *tried) > worth(scores, chosen, refined) + AMBIGUOUS:
            chosen, refined = tried
    return chosen, refined


def beside_joint_or_arm(
    evidence: Evidence, scores: Scores, causes: Sequence[Cause], refined: Refined
) -> Iterator[Cause]:
    """The causes, ``refined`` together, of which those that may be a law of the whole arm, or of a joint
    (`of_joint_or_arm`), have it as an alternative, as far behind as it is."""
    chosen = [cause.candidate for cause in causes]
    tried = [(gone, _with_another(evidence, scores, gone, chosen)) for gone in in_its_place(scores, chosen)]
    whole = worth(scores, chosen, refined)
    others = [(gone, Alternative(t[0][-1], max(whole - worth(scores, *t), 0.0))) for gone, t in tried if t is not None]
    for cause in causes:
        for gone, other in others:
            cause = cause.beside(other, scores) if cause.candidate in gone else cause
        yield cause


def in_its_place(scores: Scores, chosen: Sequence[int]) -> list[list[int]]:
    """Those of the chosen that one law could stand for: each of the whole arm; of each joint what looks like such a
    law, with what looks like that in turn; and all of them."""
    alone = [[k] for k in chosen if scores.hypothesis(k).place.joint is None and _laws(scores, k)]
    like = [k for k in chosen if scores.hypothesis(k).place.joint is not None and _laws(scores, k)]
    joints: dict[Place, list[int]] = {}
    for place in dict.fromkeys(scores.hypothesis(k).place for k in like):
        there = [k for k in chosen if scores.hypothesis(k).place == place]
        names = {name for k in there for name in scores.hypothesis(k).effect.looks_like}
        joints[place] = [k for k in there if k in like or scores.hypothesis(k).effect.name in names]
    groups = [*alone, *joints.values()]
    return [*groups, [k for group in groups for k in group]] if len(groups) > 1 else groups


def _laws(scores: Scores, candidate: int) -> list[int]:
    """The candidates of the whole arm that a law of one joint looks like, or those of one joint that look like a law of
    the whole arm."""
    own, laws = scores.hypothesis(candidate), scores.design.hypotheses
    of_joint = own.place.joint is not None
    return [
        k
        for k, other in ((k, laws[owner]) for k, owner in enumerate(scores.owner))
        if of_joint is (other.place.joint is None)
        and (other.effect.name in own.effect.looks_like if of_joint else own.effect.name in other.effect.looks_like)
    ]


def _at_other_shapes(scores: Scores, candidate: int) -> list[int]:
    """The candidates of the law of the whole arm that one is: the one that was chosen may have led to no best shape."""
    law = scores.owner[candidate]
    of_arm = scores.design.hypotheses[law].place.joint is None
    return list(map(int, np.flatnonzero(scores.owner == law))) if of_arm else []


def _with_another(
    evidence: Evidence, scores: Scores, gone: Sequence[int], chosen: Sequence[int], anew: bool = False
) -> tuple[list[int], Refined] | None:
    """The chosen with the best of the laws that could stand for those that are ``gone``, the last, in their place; None
    where none comes near them. With ``anew``, one of them at another shape is tried too."""
    others = [k for k in chosen if k not in gone]
    same = [k for own in gone for k in _at_other_shapes(scores, own)] if anew else []
    laws = {k for own in gone for k in _laws(scores, own)} | set(same)
    laws = {k for k in laws if scores.owner[k] not in scores.owner[others]}
    gains = scores.gains(others)
    best = sorted(laws, key=lambda k: gains[k])[-_STARTS:]
    least = _HOPELESS * (scores.nats(chosen) - scores.nats(others))
    trials = [([*others, k], fitted(evidence, scores, [*others, k])) for k in best if gains[k] > least]
    able = [one for one in trials if _last_comes_and_goes(evidence, one[1])]
    return max(able, key=lambda one: worth(scores, *one), default=None)


def _last_comes_and_goes(evidence: Evidence, refined: Refined) -> bool:
    own = refined.design.candidates[-1]
    return now_and_then(evidence, refined.design.hypotheses[own.hypothesis], own.theta)


def now_and_then(evidence: Evidence, law: Hypothesis, theta: Array) -> bool:
    """Whether a law acts no longer than one of its name does: a wall that the tool is never in front of is a spring of
    any form."""
    if not law.effect.comes_and_goes:
        return True
    acts = [np.any(law.effect.columns(law.place, p.signals, theta) != 0.0, axis=(1, 2)) for p in evidence.pieces]
    return float(np.concatenate(acts).mean()) < _MOST_OF_THE_TIME
