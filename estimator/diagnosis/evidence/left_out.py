"""What a candidate is worth on rows left out: evidence of all rows less evidence of those that stay.

log p(out | stay) = log p(out, stay) − log p(stay), every unknown integrated over its prior. What the rows that stay do
not tell of the given model widens the prediction, instead of being guessed: an arm of which the kinematics alone are
known has many such directions. A candidate's coefficients have the prior that is worth one row of all (unit
information; Kass and Wasserman 1995), so it has no scale of its own.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cho_factor, cho_solve

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]
Indices = NDArray[np.intp]

_TOLD = 1e-9
"""Share of a column's energy below which nothing of it is left to tell."""
_FREE = 1e-6
"""Of the information of the rows that stay, what is known before of causes that were chosen already."""


def gains_left_out(whole: Conditional, staying: Sequence[Conditional], columns: Indices) -> Array:
    """(folds,) nats by which ``columns`` improve the prediction of each fold by the rows that stay without it.

    ``whole``: the other unknowns fitted to all rows; ``staying``: to all but each fold.
    """
    prior = unit_information(whole, columns)
    return log_evidence(whole, columns, prior) - np.array([log_evidence(one, columns, prior) for one in staying])


def gains_carried_over(
    design: Design, parts: Sequence[tuple[Block, Block]], weights: Array, whole: Conditional, columns: Indices
) -> Array:
    """(folds,) nats by which ``columns``, the design's last, improve the prediction of each fold when the rows that
    stay tell of causes alone, and the given model is judged afresh by its tolerance.

    Links, or a channel's timing, that leave their tolerance in a cause's stead are believed once the rows that stay
    have bent them, and predict as well as the cause does. What tells against them is that every fold must bend them
    anew. ``parts``: of each fold the rows that stay, and its own; ``whole`` as in `gains_left_out`.
    """
    causes = np.arange(design.given, design.size)
    former = len(causes) - len(columns)
    own = unit_information(whole, columns)
    directions = np.zeros((len(causes), former + own.shape[1]))
    directions[former:, former:] = own
    precision = np.ones(former + own.shape[1])
    given, gains = np.arange(design.given), []
    for staying, out in parts:
        (there, told, energy), (more, anew, _) = (
            Conditional(Weighted(design, block, weights), given).left_of(causes) for block in (staying, out)
        )
        scale = 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0))
        directions[:former, :former] = np.diag(scale[:former])
        precision[:former] = _FREE
        turned = [
            (directions.T @ matrix @ directions, directions.T @ score)
            for matrix, score in ((there, told), (there + more, told + anew))
        ]
        before, after = (
            [_integrated(matrix[:k, :k] + np.diag(precision[:k]), score[:k]) for k in (former, len(precision))]
            for matrix, score in turned
        )
        gains.append((after[1] - before[1]) - (after[0] - before[0]))
    return np.array(gains)


def _integrated(precision: Array, score: Array) -> float:
    """log ∫ exp(scoreᵀx − ½·xᵀ·precision·x) dx, less what does not depend on the rows."""
    if not len(score):
        return 0.0
    factor = cho_factor(precision, lower=True)
    return float(0.5 * score @ cho_solve(factor, score) - np.sum(np.log(np.diag(factor[0]))))


def unit_information(whole: Conditional, columns: Indices) -> Array:
    """(c, r) directions of coefficients in which the prior is standard normal: the information of one row on average,
    after the active unknowns. What they leave nothing of has no direction."""
    matrix, _, energy = whole.left_of(columns)
    scale = np.where(energy > 0.0, 1.0 / np.sqrt(np.where(energy > 0.0, energy, 1.0)), 0.0)
    values, vectors = np.linalg.eigh(matrix * np.outer(scale, scale))
    told = values > _TOLD
    return np.asarray(scale[:, None] * vectors[:, told] * np.sqrt(whole.told.block.rows / values[told]))


def log_evidence(model: Conditional, columns: Indices, prior: Array) -> float:
    """log p(rows with the columns) − log p(rows without), the active unknowns and the coefficients integrated out:
    ½·sᵀA⁻¹s − ½·log det A with A = 1 + S, of what the active unknowns leave."""
    if not prior.shape[1]:
        return 0.0
    matrix, score, _ = model.left_of(columns)
    inner = np.eye(prior.shape[1]) + prior.T @ matrix @ prior
    factor = cho_factor(inner, lower=True)
    projected = prior.T @ score
    return float(0.5 * projected @ cho_solve(factor, projected) - np.sum(np.log(np.diag(factor[0]))))
