"""A noise that no repeats tell, once the causes are known: what they leave of each channel, widened.

At first it is assumed to be what the richest model leaves (`estimator.diagnosis.observed.assumed_noise`), of which much
may be an effect that no direction of that model resembles. Whatever a model with fewer unknowns leaves holds the whole
noise, so where that is less, and of another colour, the noise is no more than that.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from estimator.diagnosis.evidence.gathered import Evidence, exactness
from estimator.diagnosis.evidence.grams import sheets
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.torques import rows_of
from estimator.diagnosis.observed.noise import ASSUMED_ORDER, WIDENED, autocovariance, autoregressive


def by_what_is_left(evidence: Evidence, scores: Scores, chosen: Sequence[int]) -> Evidence:
    """The evidence under the noise that a model with the ``chosen`` candidates leaves, channel by channel where that is
    less than what was assumed."""
    design, noise = evidence.design, evidence.noise
    model = scores.model(chosen)
    value = np.zeros(design.size)
    value[model.active] = model.value
    left = [rows_of(design, *piece, value) for piece in zip(evidence.pieces, evidence.decimations, strict=True)]
    rows = sum(len(own) for own in left)
    free = max(1.0, rows - len(model.active) / len(design.channels))
    unseen = evidence.unseen + exactness(evidence.pieces)
    covariance = WIDENED**2 * rows / free * autocovariance(left) + unseen
    rms = np.sqrt(covariance[:, 0])
    less = rms < noise.rms
    filters = np.array([autoregressive(row, free, ASSUMED_ORDER) for row in covariance])
    told = replace(noise, filters=np.where(less[:, None], filters, noise.filters), rms=np.where(less, rms, noise.rms))
    blocks = [sheet.compact() for sheet in sheets(design, evidence.pieces, evidence.decimations, told, evidence.parts)]
    return replace(evidence, noise=told, blocks=tuple(blocks))
