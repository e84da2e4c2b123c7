"""A wall that the tool presses into, which one joint's angle may show as a bent spring, or as slow lines.

A search tries walls by twenty-six directions and three depths each, and so the laws of a joint, which have shapes near
the true one, come before them. Here both are at their best.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.refinement import Refined, fitted
from estimator.diagnosis.rivals import AMBIGUOUS, Alternative
from estimator.diagnosis.scores import Scores
from estimator.diagnosis.search import Cause
from estimator.diagnosis.slow_forms import worth

_STARTS = 4
"""Candidates of the whole arm from which the best shape is sought."""
_HOPELESS = 0.4
"""Of what the laws of the joints explain, the least that such a candidate explains in their stead on the grid."""


def of_a_wall(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen with a law of the whole arm in the place of those of single joints that look like it, of one joint or
    of all, where it is better, all at their best shapes."""
    for gone in _in_its_place(scores, chosen):
        if not set(gone) <= set(chosen):
            continue
        tried = _with_a_wall(evidence, scores, gone, chosen)
        if tried is not None and worth(scores, *tried) > worth(scores, chosen, refined) + AMBIGUOUS:
            chosen, refined = tried
    return chosen, refined


def beside_a_wall(evidence: Evidence, scores: Scores, causes: Sequence[Cause], refined: Refined) -> Iterator[Cause]:
    """The causes, ``refined`` together, of which those that may be a law of the whole arm (`of_a_wall`) have it as an
    alternative, as far behind as it is."""
    chosen = [cause.candidate for cause in causes]
    behind: dict[int, Alternative] = {}
    for gone in _in_its_place(scores, chosen):
        if (tried := _with_a_wall(evidence, scores, gone, chosen)) is None:
            continue
        gap = max(worth(scores, chosen, refined) - worth(scores, *tried), 0.0)
        for k in gone:
            if gap < min(AMBIGUOUS, behind[k].gap if k in behind else np.inf):
                behind[k] = Alternative(tried[0][-1], gap)
    for cause in causes:
        if (other := behind.get(cause.candidate)) is not None:
            law = scores.owner[other.candidate]
            kept = [a for a in cause.alternatives if scores.owner[a.candidate] != law]
            cause = replace(cause, alternatives=tuple(sorted([*kept, other], key=lambda one: one.gap)))
        yield cause


def _in_its_place(scores: Scores, chosen: Sequence[int]) -> list[list[int]]:
    """Those of the chosen that a law of the whole arm could stand for: of each joint what looks like it, with what
    looks like that in turn, and those of all joints."""
    like = [k for k in chosen if _laws(scores, k)]
    by_joint: dict[int | None, list[int]] = {}
    for k in like:
        place = scores.hypothesis(k).place
        names = {name for c in like if scores.hypothesis(c).place == place for name in _looks_like(scores, c)}
        there = [c for c in chosen if scores.hypothesis(c).place == place]
        by_joint[place.joint] = [c for c in there if c in like or scores.hypothesis(c).effect.name in names]
    groups = list(by_joint.values())
    return [*groups, [k for group in groups for k in group]] if len(groups) > 1 else groups


def _looks_like(scores: Scores, candidate: int) -> tuple[str, ...]:
    return scores.hypothesis(candidate).effect.looks_like


def _laws(scores: Scores, candidate: int) -> list[int]:
    """The candidates of the whole arm that a law of one joint looks like."""
    names = _looks_like(scores, candidate)
    laws = scores.design.hypotheses
    return [k for k, own in enumerate(scores.owner) if laws[own].place.joint is None and laws[own].effect.name in names]


def _with_a_wall(
    evidence: Evidence, scores: Scores, gone: Sequence[int], chosen: Sequence[int]
) -> tuple[list[int], Refined] | None:
    """The chosen with the best of the laws of the whole arm, the last, in the place of those that are ``gone``; None
    where none comes near them."""
    others = [k for k in chosen if k not in gone]
    laws = sorted({k for own in gone for k in _laws(scores, own)})
    if any(scores.owner[k] in scores.owner[laws] for k in others):
        return None
    gains = scores.gains(others)
    # Where the arm moves in a plane, directions that differ across it are the same.
    apart = {float(np.round(gains[k], 6)): k for k in laws}
    best = [apart[gain] for gain in sorted(apart)[-_STARTS:]]
    least = _HOPELESS * (scores.nats(chosen) - scores.nats(others))
    trials = [([*others, k], fitted(evidence, scores, [*others, k])) for k in best if gains[k] > least]
    return max(trials, key=lambda one: worth(scores, *one), default=None)
