"""How large a gain chance alone gives: the resampled maximum over all hypotheses.

Noise is drawn in the space of the Gram matrices (products of columns with white noise are Gaussian with the Gram
matrix as covariance), the given model's deviations from its tolerance. Each hypothesis' gains under chance are
described by a gamma law; the most surprising hypothesis of each draw says how surprised one must be (Westfall and
Young 1993).
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from estimator.diagnosis.bounded import bounded_gains
from estimator.diagnosis.conditional import Conditional, Group

Array = NDArray[np.float64]

DRAWS = 200
_RIDGE = 1e-11
"""Share of a column's energy that is noise of its own: columns that say the same have a root too."""


@dataclass(frozen=True)
class Chance:
    """Gains of hypotheses that chance gives."""

    shape: Array
    scale: Array
    """(hypotheses,) of the gamma law of each one's gain; its mean is their product."""
    tests: float
    """As many independent tests behave like this family of hypotheses."""

    def surprise(self, gains: Array) -> Array:
        """(…, hypotheses) −log probability of gains (…, hypotheses) under chance, one hypothesis at a time."""
        with np.errstate(divide="ignore"):
            return np.asarray(-np.log(gammaincc(self.shape, np.maximum(gains, 0.0) / self.scale)))

    def false_alarm(self, hypothesis: int, gain: float) -> float:
        """Probability that chance makes any hypothesis of the family as surprising as this one."""
        alone = gammaincc(self.shape[hypothesis], max(gain, 0.0) / self.scale[hypothesis])
        return float(-np.expm1(-self.tests * alone))


def resample(model: Conditional, groups: list[Group], noise: Array, seed: int = 0) -> Chance:
    """By `DRAWS` draws of the base parameters beside those of ``noise`` (`drawn_noise` of the same design, block and
    weights), everything else being as the given model has it."""
    design = model.design
    score = _null_scores(model, noise, seed)
    count = len(design.hypotheses)
    gains = np.zeros((count, DRAWS))
    for group in groups:
        matrix, energy = model.remaining(group)
        lower, upper = group.lower, group.upper
        own = bounded_gains(matrix, score[group.columns], energy, lower, upper)
        for row, candidate in zip(own, group.candidates, strict=True):
            hypothesis = design.candidates[candidate].hypothesis
            np.maximum(gains[hypothesis], row, out=gains[hypothesis])
    mean = np.maximum(gains.mean(axis=1), 1e-3)
    variance = np.maximum(gains.var(axis=1), 1e-6)
    # The tail matters: no lighter than that of one Gaussian coefficient.
    scale = np.maximum(variance / mean, 1.0)
    law = Chance(mean / scale, scale, 1.0)
    surprises = law.surprise(gains.T)
    tested = np.isin(np.arange(count), [c.hypothesis for c in design.candidates])
    largest = surprises[:, tested].max(axis=1)
    # P(max < x) = exp(−tests·e^−x): tests by maximum likelihood.
    return Chance(law.shape, law.scale, float(1.0 / np.mean(np.exp(-largest))))


def drawn_noise(model: Conditional, seed: int = 0) -> Array:
    """(size, DRAWS) products of all columns with white noise, whatever the model's tolerance."""
    design, random = model.design, np.random.default_rng(seed)
    products = np.zeros((design.size, DRAWS))
    for channel, gram in enumerate(model.block.grams):
        members, weight = design.members[channel], model.weights[channel]
        inner = gram[:-1, :-1]
        # Columns of very different size: rounding of the largest must not be the noise of the smallest.
        norms = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
        normal = inner / np.outer(norms, norms) + _RIDGE * np.eye(len(norms))
        root = norms[:, None] * np.linalg.cholesky(normal)
        products[members] += np.sqrt(weight) * (root @ random.standard_normal((len(members), DRAWS)))
    return products


def _null_scores(model: Conditional, noise: Array, seed: int) -> Array:
    """(size, DRAWS) products of all columns with a residual of chance, after the active unknowns.

    A deviation d of the given model, of precision P, leaves A⁻¹P·d of itself where A is the active unknowns' normal
    matrix; P·d is drawn, which is small where the given model is free.
    """
    given, random = model.design.given, np.random.default_rng([seed, 1])
    pull = np.zeros((len(model.active), DRAWS))
    pull[:given] = np.linalg.cholesky(model.design.precision) @ random.standard_normal((given, DRAWS))
    return np.asarray(noise - model.cross.T @ model.solve(noise[model.active] - pull))
