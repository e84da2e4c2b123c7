"""Whether rows left out bear a candidate out: what it adds to their prediction, in standard errors over what is left
out together."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from functools import cache

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.folds import Folds
from estimator.diagnosis.evidence.grams import Block, Sheet, of_each, part_of, total, without_each
from estimator.diagnosis.evidence.left_out import gains_carried_over, gains_left_out
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]

BORNE_OUT = 1.64
"""Standard errors by which a held-out gain must be above zero; beyond, nothing more is asked."""
_OTHERS = 3
"""Folds at least that bear out what another one shows, or what all show that say anything of it."""
_SAYS_NOTHING = 1.0
"""nats: what says no more for a cause, nor against it, is of a fold in which it does not act."""
_BY_CHANCE = -0.5 * BORNE_OUT**2
"""nats: no less than that do motions lose together by a cause that is there, however little they show of it. Of a gain
g = s/2 + z·√s it is the least, z standard errors below what is expected."""


def predicting(
    design: Design,
    blocks: Sequence[Block | Sheet],
    folds: Folds,
    weights: Array,
    others: Sequence[int],
    candidate: int,
) -> tuple[float, float]:
    """Log-likelihood that a candidate adds, beside ``others``, to the prediction of what is left out, in standard
    errors: with the given model as the rows that stay bend it, and with it afresh within its tolerance. The second is
    worked out only where the first does not bear it out."""
    design, kept = part_of(design, blocks, [*others, candidate])
    # The sum of these very parts: what one fold alone shows is then left out to the last digit.
    whole = total(kept)
    columns = design.candidates[-1].columns
    active = np.arange(design.size - len(columns))
    first = Conditional(Weighted(design, whole, weights), active)

    def bent(staying: Sequence[Block], out: Sequence[Block]) -> Array:
        without = [Conditional(Weighted(design, block, weights), active) for block in staying]
        return gains_left_out(first, without, columns)

    def afresh(staying: Sequence[Block], out: Sequence[Block]) -> Array:
        return gains_carried_over(design, list(zip(staying, out, strict=True)), weights, first, columns)

    @cache
    def divided(numbers: tuple[int, ...]) -> tuple[list[Block], list[Block]]:
        return without_each(whole, kept, numbers), of_each(kept, numbers)

    def over(gains_of: Callable[[Sequence[Block], Sequence[Block]], Array]) -> float:
        """Over whole motions; where one of them shows it alone, and the others do not speak against it, over parts."""
        gains = gains_of(*divided(folds.motions))
        told = in_errors(gains)
        if told < BORNE_OUT and folds.parts and one_shows(gains):
            told = max(told, in_errors(gains_of(*divided(folds.parts))))
        return told

    told = over(bent)
    return told, told if told >= BORNE_OUT else over(afresh)


def one_shows(gains: Array) -> bool:
    """Whether one fold shows more than all others together, and they no less than chance leaves them."""
    *others, largest = np.sort(gains)
    return bool(largest > max(sum(others), 0.0) and sum(others) >= _BY_CHANCE)


def in_errors(gains: Array) -> float:
    """The sum of the folds' gains in its standard errors; that of all but the largest where it is more, or of those
    that say anything. A motion that shows far more than the others, as one that was designed to, would be all of the
    scatter, and so would the parts of motions in which a joint stands still: the others bear it out then. Where every
    fold speaks for it, none counts for more than their median: that one shows still more is nothing against it."""
    kept = [np.sort(gains)[:-1], gains[np.abs(gains) > _SAYS_NOTHING]]
    if np.all(gains > _SAYS_NOTHING):
        kept.append(np.minimum(gains, np.median(gains)))
    return max(_told_by(some) for some in (gains, *(k for k in kept if len(k) >= _OTHERS)))


def _told_by(gains: Array) -> float:
    return float(gains.sum()) / max(float(gains.std(ddof=1) * np.sqrt(len(gains))), 1e-12)
