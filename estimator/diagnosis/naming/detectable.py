"""The smallest size of each effect that these recordings would have shown."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.design import Candidate, Hypothesis
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import FALSE_ALARM, LEAST_SEEN
from estimator.diagnosis.telling.quantities import unit_of
from estimator.effects import Parameters

Array = NDArray[np.float64]


def smallest_detectable(scores: Scores, chosen: list[int]) -> tuple[dict[str, dict[int | None, float]], dict[str, str]]:
    """By effect and joint: the value of the effect's first measured parameter at which the expected evidence reaches
    the threshold whatever its shape, all other coefficients of the effect zero; and by effect the parameter's unit (two
    where some joints turn and others slide). What the motion cannot show at all is left out."""
    design, model = scores.design, scores.model(chosen)
    chance = -np.log(FALSE_ALARM / scores.chance.tests)
    threshold = max(chance, 0.5 * LEAST_SEEN * scores.total.rows)
    result: dict[str, dict[int | None, float]] = {}
    units: dict[str, dict[str, None]] = {}
    strongest = _strongest(scores)
    for group in scores.groups:
        matrix, energy = model.remaining(group)
        for k, number in enumerate(group.candidates):
            candidate = design.candidates[number]
            visible = matrix[k, 0, 0]
            if visible <= 1e-9 * max(energy[k, 0], 1e-6 * strongest[_effect(scores, number)]):
                continue
            hypothesis = design.hypotheses[candidate.hypothesis]
            if scores.is_map[candidate.hypothesis]:
                continue
            told = _parameter(hypothesis, candidate, float(np.sqrt(2.0 * threshold / visible)))
            if told is None:
                continue
            parameter, size, parameters, faintest = told
            own = result.setdefault(hypothesis.effect.name, {})
            joint = hypothesis.place.joint
            own[joint] = faintest(size, own.get(joint, size))
            unit = unit_of(hypothesis, parameter, parameters, design.body)
            units.setdefault(hypothesis.effect.name, {})[unit] = None
    return result, {name: ", ".join(own) for name, own in units.items()}


def _parameter(
    hypothesis: Hypothesis, candidate: Candidate, coefficient: float
) -> tuple[str, float, Parameters, Callable[[float, float], float]] | None:
    """The first parameter that the first coefficient changes: by how much that coefficient changes it, or its value
    where the effect's absence is no number (an endless stiffness); all that it then has; and which of two sizes hides
    less. None when there is no such parameter."""
    x = np.zeros(len(candidate.columns))
    absent = hypothesis.effect.parameters(hypothesis.place, candidate.theta, x)
    x[0] = coefficient if candidate.upper[0] > 0.0 else -coefficient
    present = hypothesis.effect.parameters(hypothesis.place, candidate.theta, x)
    for name, value in present.items():
        without = absent.get(name, np.inf)
        if isinstance(value, float) and isinstance(without, float) and value != without and np.isfinite(value):
            if np.isfinite(without):
                return name, abs(value - without), present, max
            return name, abs(value), present, min
    return None


def _effect(scores: Scores, candidate: int) -> str:
    design = scores.design
    return design.hypotheses[design.candidates[candidate].hypothesis].effect.name


def _strongest(scores: Scores) -> dict[str, float]:
    """Of each effect, the largest energy of a first column anywhere: what is a millionth of a millionth of it is
    rounding."""
    result: dict[str, float] = {}
    model = scores.model([])
    for group in scores.groups:
        _, energy = model.remaining(group)
        for k, number in enumerate(group.candidates):
            name = _effect(scores, int(number))
            result[name] = max(result.get(name, 0.0), float(energy[k, 0]))
    return result
