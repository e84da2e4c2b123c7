"""The smallest size of each effect that these recordings would have shown."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.design import Candidate, Hypothesis
from estimator.diagnosis.search import FALSE_ALARM, Search

Array = NDArray[np.float64]


def smallest_detectable(search: Search, chosen: list[int]) -> dict[str, dict[int | None, float]]:
    """By effect and joint: the value of the effect's first measured parameter at which the expected evidence reaches
    the threshold, all other coefficients of the effect zero. What the motion cannot show at all is left out."""
    design, model = search.design, search.model(chosen)
    threshold = -np.log(FALSE_ALARM / search.chance.tests)
    result: dict[str, dict[int | None, float]] = {}
    for group in search.groups:
        matrix, energy = model.remaining(group)
        for k, number in enumerate(group.candidates):
            candidate = design.candidates[number]
            visible = matrix[k, 0, 0]
            if visible <= 1e-9 * energy[k, 0]:
                continue
            hypothesis = design.hypotheses[candidate.hypothesis]
            size = _parameter(hypothesis, candidate, float(np.sqrt(2.0 * threshold / visible)))
            if size is None:
                continue
            own = result.setdefault(hypothesis.effect.name, {})
            joint = hypothesis.place.joint
            own[joint] = max(size, own.get(joint, 0.0))
    return result


def _parameter(hypothesis: Hypothesis, candidate: Candidate, coefficient: float) -> float | None:
    """The first parameter that the first coefficient changes, at that coefficient; None when there is none."""
    x = np.zeros(len(candidate.columns))
    x[0] = coefficient if candidate.upper[0] > 0.0 else -coefficient
    small = hypothesis.effect.parameters(hypothesis.place, candidate.theta, x)
    large = hypothesis.effect.parameters(hypothesis.place, candidate.theta, 2.0 * x)
    for name, value in small.items():
        if isinstance(value, float) and value != large[name] and np.isfinite(value):
            return abs(value)
    return None
