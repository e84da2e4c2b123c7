"""How well the links of the given model are known: within its tolerance, or better where the recordings bear them out.

Links that are right to a hundredth of their tolerance wherever recordings tell them are not off by all of it in the one
direction of a payload. The search is made under tolerances that are tighter by steps, and each answer has its evidence,
log p(recordings | tolerance, causes): the links' deviations are integrated over their prior, of which a tighter one
promises more and is believed when it keeps its promise (type II maximum likelihood; MacKay 1992).
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from estimator.consistency import prior_precision
from estimator.diagnosis.admission import FALSE_ALARM
from estimator.diagnosis.conditional import products, within_limits
from estimator.diagnosis.design import Design
from estimator.diagnosis.evidence import Evidence
from estimator.diagnosis.exchange import exchange
from estimator.diagnosis.scores import Scores
from estimator.diagnosis.search import Cause, Search
from estimator.diagnosis.tolerance import base_precision

Array = NDArray[np.float64]

TIGHTER = (0.3, 0.1, 0.03, 0.01, 0.003)
"""Of the tolerance, to which links may be known that the recordings bear out."""
_MARGIN = -float(np.log(FALSE_ALARM))
"""nats by which a tighter tolerance with other causes must be better supported."""
_MARGIN_OF_A_LINK = 3.0 * _MARGIN
"""The same where such a cause is a link: where one link happens to be off by most of its tolerance, it looks as if the
others were exact."""
_HOPELESS = 50.0
"""nats behind the best, at which no tighter tolerance is tried."""
_EXACT = 0.03
"""Of the tolerance: where all other links are as exact as this, one may be off."""
_INERTIAL = ("link_inertia", "payload")
_OFF = 3.0
"""Tolerances by which a link that is off is taken to be off."""


@dataclass(frozen=True)
class Searched:
    """The causes under the tolerance that is best supported."""

    evidence: Evidence
    """Its design has that tolerance."""
    scores: Scores
    causes: list[Cause]
    widest: Scores
    """Under the tolerance that was given."""
    borne_out: float | None = None
    """The tolerance, where it is tighter than that one."""

    @property
    def chosen(self) -> list[int]:
        return [cause.candidate for cause in self.causes]

    @property
    def hypotheses(self) -> set[int]:
        return {int(self.scores.owner[k]) for k in self.chosen}

    def of(self, *effects: str) -> set[int]:
        """Those of some effects."""
        return {k for k in self.hypotheses if self.scores.design.hypotheses[k].effect.name in effects}


def searched(evidence: Evidence) -> Searched:
    """Searches the evidence for causes, under its own tolerance and under the tighter ones."""
    noise = evidence.noise
    mixed = exchange(evidence.pieces, evidence.repeats, evidence.grid, noise) if noise.playings else None
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, noise.news, mixed)
    first = best = Searched(evidence, scores, Search(scores).run(), scores)
    if evidence.tolerance is None:
        return best
    weights = first.scores.weights.copy()
    most = _support(best, weights, evidence.tolerance)
    for share in TIGHTER:
        tighter = share * evidence.tolerance
        known = scores.known_to(_precision(evidence.design, tighter))
        tried = Searched(replace(evidence, design=known.design), known, Search(known).run(), scores, tighter)
        support = _support(tried, weights, evidence.tolerance)
        if _believable(tried, first, share) and support > most + _margin(tried, best):
            best, most = tried, support
        elif support < most - _HOPELESS:
            break
    return best


def _believable(tried: Searched, first: Searched, share: float) -> bool:
    """Not where links or loads are causes that the given tolerance leaves no room for, but one on an exact arm: else
    two links may be anything, and the rest is exact."""
    new = tried.of(*_INERTIAL) - first.of(*_INERTIAL)
    return not new or (share <= _EXACT and len(tried.of(*_INERTIAL)) == 1)


def _margin(tried: Searched, best: Searched) -> float:
    new = tried.hypotheses - best.hypotheses
    return _MARGIN_OF_A_LINK if new & tried.of("link_inertia") else _MARGIN if new else 0.0


def _precision(design: Design, tolerance: float) -> Array:
    """The design's precision with another tolerance of the links."""
    precision, rank = design.precision.copy(), design.base.rank
    precision[:rank, :rank] = base_precision(design.body, design.base, tolerance)
    return precision


def _support(found: Searched, weights: Array, tolerance: float) -> float:
    """nats of evidence for an answer and its tolerance at these weights, up to a constant."""
    scores, design = found.scores, found.scores.design
    model = within_limits(design, scores.total, weights, [design.candidates[k] for k in found.chosen], least=1)
    given = np.arange(design.given)
    told = products(design, scores.total, weights, given, given)
    narrowed = np.linalg.slogdet(design.precision + told)[1] - np.linalg.slogdet(design.precision)[1]
    explained = 0.5 * float(model.right[model.active] @ model.value)
    links = [k for k in found.chosen if scores.hypothesis(k).effect.name == "link_inertia"]
    others = [k for k in found.chosen if k not in links]
    freedom = scores.penalty(others) + max(scores.penalty(links), _of_links(found, links, others, weights, tolerance))
    return explained - 0.5 * float(narrowed) - freedom


def _of_links(found: Searched, links: list[int], others: list[int], weights: Array, tolerance: float) -> float:
    """nats that it costs to let these links go: no less than to let all give within their tolerance, where all that is
    told of them is known as well. Neighbours share what is told, and one that is let go takes it all."""
    if not links:
        return 0.0
    scores, body = found.scores, found.scores.design.body
    candidates = [scores.design.candidates[k] for k in others]
    model = within_limits(scores.design, scores.total, weights, candidates, least=1)
    told, _, _ = model.left_of(np.concatenate([scores.design.candidates[k].columns for k in links]))
    span = [10 * (scores.hypothesis(k).place.joint or 0) for k in links]
    own = [np.linalg.inv(prior_precision(body.prior()[k : k + 10], _OFF * tolerance)) for k in span]
    return 0.5 * float(np.linalg.slogdet(np.eye(len(told)) + block_diag(*own) @ told)[1])
