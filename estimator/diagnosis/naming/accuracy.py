"""How well the given model is known: its links within their tolerance, its channels' timings within theirs, or better
where the recordings bear them out.

Links that are right to a hundredth of their tolerance wherever recordings tell them are not off by all of it in the one
direction of a payload, and of drives whose torques are in time to a hundredth of a sample the one that is late by a
fifth is late. The search is made under tolerances that are tighter by steps, and each answer has its evidence,
log p(recordings | tolerance, causes): the deviations are integrated over their prior, of which a tighter one promises
more and is believed when it keeps its promise (type II maximum likelihood; MacKay 1992).
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from estimator.diagnosis.evidence.conditional import within_limits
from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.exchange import Exchange, exchange, with_slow_motion
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.admission import FALSE_ALARM
from estimator.diagnosis.naming.search import Search
from estimator.diagnosis.observed.tolerance import base_precision

Array = NDArray[np.float64]

TIGHTER = (0.3, 0.1, 0.03, 0.01, 0.003)
"""Of the tolerance, to which links may be known that the recordings bear out."""
PUNCTUAL = (0.3, 0.1, 0.03)
"""Likewise of the tolerance of the channels' timings."""
_FINELY = np.geomspace(1.0, TIGHTER[-1], 18)
"""Of the tolerance, among which each answer has the one that suits it best."""
_MARGIN = -float(np.log(FALSE_ALARM))
"""nats by which an answer with another cause under a tighter tolerance must be better supported, where that is all but
none; twice that under any other, since no tolerance is the law by which links are off, and where the noise is assumed,
so that nats are known roughly; and so for each such cause."""
_HOPELESS = 50.0
"""nats behind the best, at which no tighter tolerance is tried."""
_EXACT = 0.03
"""Of the tolerance: links that are off by no more."""
_BEYOND = float(chi2.sf(16.0, 1))
"""Probability that is left to links within their tolerance where one is named: that of four standard deviations."""


@dataclass(frozen=True)
class Searched:
    """The causes under the tolerance that is best supported."""

    evidence: Evidence
    """Its design's precision is of that tolerance."""
    scores: Scores
    chosen: list[int]
    """Candidates of the causes."""
    widest: Scores
    """Under the tolerance that was given."""
    links: float = 1.0
    """Share of the links' tolerance under which they were found …"""
    timings: float = 1.0
    """… and of the channels' timings'."""

    @property
    def hypotheses(self) -> set[int]:
        return {int(self.scores.owner[k]) for k in self.chosen}

    @property
    def effects(self) -> set[str]:
        return {self.scores.design.hypotheses[k].effect.name for k in self.hypotheses}


def searched(evidence: Evidence, before: Searched | None = None) -> Searched:
    """Searches the evidence for causes, under its own tolerances, then under tighter ones of the links and of the
    channels' timings; ``before``: what was found with laws that were less sharp."""
    design, tolerance = evidence.design, evidence.tolerance
    if before is None:
        told, errors = evidence.noise, other_errors(evidence)
        scores = Scores(design, evidence.blocks, evidence.folds, told.news, errors, told.degrees_of_freedom)
        chosen = Search(scores).run()
    else:
        scores = before.widest.sharper(design, evidence.blocks)
        chosen = Search(scores).run(before.chosen)
    first = best = Searched(evidence, scores, chosen, scores)
    # Where a link is off by more than its tolerance, the others are not taken to be exact.
    if tolerance is not None and "link_inertia" not in first.effects:
        shares: Sequence[float] = TIGHTER if before is None or before.links == 1.0 else (before.links,)
        best, share = _tightened(first, first, shares, lambda share: _precise(design, share * tolerance))
        best = replace(best, links=share)
    known = best.evidence.design
    shares = PUNCTUAL if before is None or before.timings == 1.0 else (before.timings,)
    best, share = _tightened(best, first, shares, lambda share: _punctual(known, share))
    return replace(best, timings=share)


def _tightened(
    start: Searched, first: Searched, shares: Sequence[float], precision_of: Callable[[float], Array]
) -> tuple[Searched, float]:
    """The best supported answer, ``start`` or one under the precision of a share of a tolerance, and that share."""
    best, best_share, weights = start, 1.0, start.scores.weights.copy()
    precisions = [precision_of(share) for share in _FINELY]
    most, own = _supports(best, precisions, weights).max(), _supports(best, precisions[:1], weights).max()
    for share in shares:
        known = start.scores.known_to(precision_of(share))
        tried = replace(
            best,
            evidence=replace(start.evidence, design=known.design),
            scores=known,
            chosen=Search(known).again(best.chosen),
        )
        support = _supports(tried, precisions, weights).max()
        there = _supports(tried, [known.design.precision], weights).max()
        if tried.hypotheses == best.hypotheses:
            better = there > own
        else:
            better = _believable(tried, first, share) and support > most + _margin(tried, best, share)
        if better:
            best, best_share, most, own = tried, share, support, there
        elif there < own - _HOPELESS:
            break
    return best, best_share


def other_errors(evidence: Evidence) -> tuple[Exchange, ...]:
    """Torques beside angles with other errors than theirs, by each way that there is."""
    slow = with_slow_motion(evidence.slow, evidence.pieces, evidence.grid, evidence.noise)
    if not evidence.noise.playings:
        return (slow,)
    return exchange(evidence.pieces, evidence.repeats, evidence.grid, evidence.noise), slow


def _margin(tried: Searched, best: Searched, share: float) -> float:
    surely = share <= _EXACT and not tried.scores.assumed
    return len(tried.hypotheses - best.hypotheses) * (_MARGIN if surely else 2.0 * _MARGIN)


def _believable(tried: Searched, first: Searched, share: float) -> bool:
    """Whether no body is a cause now that the given tolerance leaves no room for: a link that is off within its
    tolerance is what the tolerance says, even if all others are better. Where those are exact, a load may be one, and a
    link that is off by far more than its tolerance."""
    new, wide = tried.effects - first.effects, first.widest
    if share > _EXACT:
        return new.isdisjoint(("link_inertia", "payload"))
    links = [k for k in tried.chosen if wide.hypothesis(k).effect.name == "link_inertia"]
    return "link_inertia" not in new or all(_beyond_tolerance(wide, k, tried.chosen) for k in links)


def _beyond_tolerance(wide: Scores, link: int, chosen: Sequence[int]) -> bool:
    """Whether a link's change costs the given tolerance more than chance does."""
    gain = wide.nats(chosen) - wide.nats([k for k in chosen if k != link])
    return gain >= nats_by_chance(wide.size(link), wide.design.body.n)


def nats_by_chance(unknowns: int, links: int) -> float:
    """nats that a change of so many unknowns hardly ever gains, of the one of so many links that gains most by it,
    where all are within their tolerance: half a chi-square of as many degrees of freedom (Wilks 1938)."""
    return 0.5 * float(chi2.isf(_BEYOND / links, max(1, unknowns)))


def _precise(design: Design, tolerance: float) -> Array:
    """The design's precision with another tolerance of the links."""
    precision, rank = design.precision.copy(), design.base.rank
    precision[:rank, :rank] = base_precision(design.body, design.base, tolerance)
    return precision


def _punctual(design: Design, share: float) -> Array:
    """The design's precision with the channels' timings known to a share of their tolerance."""
    precision, rank = design.precision.copy(), design.base.rank
    timings = slice(rank, rank + len(design.channels))
    precision[timings, timings] /= share**2
    return precision


def _supports(found: Searched, precisions: Sequence[Array], weights: Array) -> Array:
    """(precisions,) nats of evidence for an answer at these weights and under each tolerance, up to a constant.

    Answers are compared under the tolerance that suits each best: where links are off by half of theirs, a cause must
    not gain by what half a tolerance gains.
    """
    scores, chosen = found.scores, [found.scores.design.candidates[k] for k in found.chosen]
    given = np.arange(scores.design.given)
    whole = Weighted(scores.design, scores.total, weights)
    told = whole.of_given[:, given]
    result = []
    for precision in precisions:
        model = within_limits(whole.believed(precision), chosen, least=1)
        narrowed = np.linalg.slogdet(precision + told)[1] - np.linalg.slogdet(precision)[1]
        result.append(model.explained - 0.5 * float(narrowed))
    return np.array(result) - scores.penalty(found.chosen)
