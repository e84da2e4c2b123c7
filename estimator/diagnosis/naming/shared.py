"""What two joints spend together beside what one of them spends alone: a friction that is viscous of both, and of one
alone, is as well that of both at another ratio, and of the other alone.

What speeds take is a matrix D of two joints, b·(1, r)(1, r)ᵀ and one diagonal entry; each such D is the other sum too,
with that entry at the other joint. No motion tells them apart, and no size of data. Of inertias it is the same.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence

import numpy as np

from estimator.diagnosis.evidence.refinement import Refined
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.causes import Cause
from estimator.diagnosis.naming.rivals import Alternative
from estimator.effects import Place

_NOTHING = 2.0
"""Standard errors within which a coefficient is not there."""


def beside_shared(scores: Scores, causes: Sequence[Cause], refined: Refined) -> Iterator[Cause]:
    """The causes, ``refined`` together, of which those of a single joint that may be of the one it shares a
    transmission with have that as an alternative that is as good."""
    others = {(name, place): there for name, place, there in _exchanged(scores, causes, refined)}
    placed = {(scores.hypothesis(c.candidate).effect.name, scores.hypothesis(c.candidate).place) for c in causes}
    for cause in causes:
        own = scores.hypothesis(cause.candidate)
        there = others.get((own.effect.name, own.place))
        if there is not None and (own.effect.name, there) not in placed:
            candidate = _candidate(scores, own.effect.name, there)
            if candidate is not None:
                cause = cause.beside(Alternative(candidate, 0.0, decidable=False), scores)
        yield cause


def _exchanged(scores: Scores, causes: Sequence[Cause], refined: Refined) -> Iterator[tuple[str, Place, Place]]:
    """Of each cause that two joints share: an effect of a single joint, one of the joints, and the other."""
    for number, cause in enumerate(causes):
        law = scores.hypothesis(cause.candidate)
        alone = _alone(refined, number)
        for name, coefficient in law.effect.as_of_one.items():
            if coefficient == alone:
                joint, other = Place(law.place.joint), Place(law.place.other)
                yield name, joint, other
                yield name, other, joint


def _alone(refined: Refined, number: int) -> int | None:
    """The only coefficient that a cause has; None where there are several."""
    value = refined.coefficients(number)
    error = np.sqrt(np.diag(refined.covariance_of(number))[-len(value) :])
    there = np.flatnonzero(np.abs(value) > _NOTHING * error)
    return int(there[0]) if len(there) == 1 else None


def _candidate(scores: Scores, name: str, place: Place) -> int | None:
    """The first candidate of an effect at a place."""
    for number in range(len(scores.design.candidates)):
        hypothesis = scores.hypothesis(number)
        if hypothesis.effect.name == name and hypothesis.place == place:
            return number
    return None
