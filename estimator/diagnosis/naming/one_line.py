"""One line of a spectrum in the place of several that lie closer than the motion resolves.

Between two orders of the grid a strong line leaves more than the noise beside either of them, and its neighbours, some
of them in proportion to the torque, are found to mend it. At its best shape it needs none of them.
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from itertools import combinations

import numpy as np

from estimator.diagnosis.evidence.forms import FORM
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.refinement import Refined, fitted
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.slow_forms import reach, worth

_RESOLVED = 2.0 * np.pi
"""rad that two lines come apart over a joint's range, from which they are told apart as two."""
_LINES = 2
"""That may stand for all of a crowd: one of the torque's own and one of a drive's, of the same order."""


def of_one_line(evidence: Evidence, scores: Scores, chosen: list[int], refined: Refined) -> tuple[list[int], Refined]:
    """The chosen with one line, or one each of two laws, in the place of a crowd of lines of a joint, where these at
    their best shapes explain what the crowd does but for less than any form is exact to, or are as good, a nat being
    the cost of a freedom."""
    for crowd in list(_crowds(evidence, scores, chosen, refined)):
        others = [k for k in chosen if k not in crowd]
        whole = refined.explained - fitted(evidence, scores, others).explained
        for some in _fewer(scores, crowd):
            trial = [*others, *some]
            shaped = fitted(evidence, scores, trial)
            inexact = refined.explained - shaped.explained < FORM * whole
            if inexact or worth(scores, trial, shaped) > worth(scores, chosen, refined):
                chosen, refined = trial, shaped
                break
    return chosen, refined


def _crowds(evidence: Evidence, scores: Scores, chosen: Sequence[int], refined: Refined) -> Iterator[list[int]]:
    """Lines of one joint, each of which is not resolved from the next."""
    orders = {k: float(c.theta[0]) for k, c in zip(chosen, refined.design.candidates, strict=True) if scores.recurs(k)}
    for place in dict.fromkeys(scores.hypothesis(k).place for k in orders):
        lines = sorted((k for k in orders if scores.hypothesis(k).place == place), key=orders.__getitem__)
        near = _RESOLVED / reach(evidence, place)
        ends = [n for n in range(1, len(lines)) if orders[lines[n]] - orders[lines[n - 1]] >= near]
        for first, last in zip([0, *ends], [*ends, len(lines)], strict=True):
            if last - first > 1:
                yield lines[first:last]


def _fewer(scores: Scores, crowd: Sequence[int]) -> Iterator[tuple[int, ...]]:
    """Fewer lines of a crowd, no two of one law; the fewest first."""
    for count in range(1, min(_LINES, len(crowd) - 1) + 1):
        for some in combinations(crowd, count):
            if len({int(scores.owner[k]) for k in some}) == count:
                yield some
