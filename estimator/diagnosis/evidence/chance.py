"""How large a gain chance alone gives: the resampled maximum over all hypotheses.

Noise is drawn in the space of the Gram matrices (products of columns with white noise are Gaussian with the Gram
matrix as covariance), the given model's deviations from its tolerance. Each hypothesis' gains under chance are
described by a gamma law; the most surprising hypothesis of each draw says how surprised one must be (Westfall and
Young 1993).
"""

from __future__ import annotations

from collections.abc import Sequence
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.special import gammaincc

from estimator.diagnosis.evidence.bounded import bounded_gains
from estimator.diagnosis.evidence.conditional import Conditional, Group, groups_of

Array = NDArray[np.float64]

DRAWS = 200
_RIDGE = 1e-11
"""Share of a column's energy that is noise of its own: columns that say the same have a root too."""


class Chance:
    """Gains of hypotheses that chance gives beside the given model, everything else being as that has it. A hypothesis
    is asked when it is first needed, and all of them when one is so surprising that their number matters."""

    def __init__(self, model: Conditional, noise: Array, family: Chance | None = None, seed: int = 0) -> None:
        """``noise``: `drawn_noise` of the same design, block and weights; the base parameters are drawn beside it.
        ``family``: the same hypotheses under another tolerance, on which their number of `tests` hardly depends: by
        less than `DRAWS` tell it.

        A deviation d of the given model, of precision P, leaves A⁻¹P·d of itself where A is the active unknowns'
        normal matrix; P·d is drawn, which is small where the given model is free.
        """
        self._model, self._noise, self._family = model, noise, family
        given, random = model.design.given, np.random.default_rng([seed, 1])
        pull = np.zeros((len(model.active), DRAWS))
        pull[:given] = np.linalg.cholesky(model.design.precision) @ random.standard_normal((given, DRAWS))
        self._taken = model.halfway(noise[model.active] - pull)
        self._laws: dict[tuple[int, int], tuple[Array, Array]] = {}

    def alone(self, candidate: int, gain: float) -> float:
        """Probability that chance makes this one's hypothesis as surprising. A form of few coefficients is held against
        those with as many, and the hypothesis counts once for each number that its forms have."""
        design = self._model.design
        hypothesis, size = design.candidates[candidate].hypothesis, len(design.candidates[candidate].columns)
        forms = [k for k, c in enumerate(design.candidates) if c.hypothesis == hypothesis]
        sizes = {len(design.candidates[k].columns) for k in forms}
        if (hypothesis, size) not in self._laws:
            own = [k for k in forms if len(design.candidates[k].columns) == size]
            self._laws[hypothesis, size] = _gamma(self._gains(groups_of(design, own))[hypothesis])
        shape, scale = self._laws[hypothesis, size]
        return min(1.0, len(sizes) * float(gammaincc(shape, max(gain, 0.0) / scale)))

    def false_alarm(self, candidate: int, gain: float) -> float:
        """Probability that chance makes any hypothesis of the family as surprising as this one's."""
        return float(-np.expm1(-self.tests * self.alone(candidate, gain)))

    def excluded(self, candidate: int, gain: float, false_alarm: float) -> bool:
        """Whether that probability is no more than ``false_alarm``; of one that alone is no surprise the others are not
        asked."""
        return self.alone(candidate, gain) <= false_alarm and self.false_alarm(candidate, gain) <= false_alarm

    @cached_property
    def tests(self) -> float:
        """As many independent tests behave like this family of hypotheses."""
        if self._family is not None:
            return self._family.tests
        design = self._model.design
        gains = self._gains(groups_of(design))[np.unique([c.hypothesis for c in design.candidates])]
        shape, scale = _gamma(gains)
        with np.errstate(divide="ignore"):
            surprises = -np.log(gammaincc(shape[:, None], gains / scale[:, None]))
        # P(max < x) = exp(−tests·e^−x): tests by maximum likelihood.
        return float(1.0 / np.mean(np.exp(-surprises.max(axis=0))))

    def _gains(self, groups: Sequence[Group]) -> Array:
        """(hypotheses, DRAWS) of the groups' candidates, the best of each hypothesis."""
        model = self._model
        design, told = model.design, model.told
        result = np.zeros((len(design.hypotheses), DRAWS))
        for group in groups:
            own, cross = told.of_each(group.columns), told.of_active(model.active, group.columns.ravel())
            half = model.halfway(cross).T.reshape(*group.columns.shape, -1)
            matrix, energy = own - half @ half.transpose(0, 2, 1), np.einsum("kcc->kc", own)
            score = self._noise[group.columns] - half @ self._taken
            gains = bounded_gains(matrix, score, energy, group.lower, group.upper)
            np.maximum.at(result, [design.candidates[k].hypothesis for k in group.candidates], gains)
        return result


def _gamma(gains: Array) -> tuple[Array, Array]:
    """Shape and scale (…) of the gamma law with the mean and variance of gains (…, DRAWS)."""
    mean = np.maximum(gains.mean(axis=-1), 1e-3)
    variance = np.maximum(gains.var(axis=-1), 1e-6)
    # The tail matters: no lighter than that of one Gaussian coefficient.
    scale = np.maximum(variance / mean, 1.0)
    return mean / scale, scale


def drawn_noise(model: Conditional, seed: int = 0) -> Array:
    """(size, DRAWS) products of all columns with white noise, whatever the model's tolerance."""
    design, random = model.design, np.random.default_rng(seed)
    result = np.zeros((design.size, DRAWS))
    for channel, gram in enumerate(model.told.block.grams):
        members, weight = design.members[channel], model.told.weights[channel]
        inner = gram[:-1, :-1]
        # Columns of very different size: rounding of the largest must not be the noise of the smallest.
        norms = np.sqrt(np.maximum(np.diag(inner), np.finfo(float).tiny))
        normal = inner / norms
        normal /= norms[:, None]
        normal.flat[:: len(norms) + 1] += _RIDGE
        drawn = np.linalg.cholesky(normal) @ random.standard_normal((len(members), DRAWS))
        result[members] += (np.sqrt(weight) * norms)[:, None] * drawn
    return result
