"""Shapes that a law's own coefficients tell, before slopes improve them.

A grid's shape beside which a coefficient has another size than the shape says is hardly the right one, and slopes may
lead farther from that.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional, within_limits
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.weighted import Weighted

Array = NDArray[np.float64]
Pass = Callable[[Sequence[Candidate]], tuple[Design, Block]]
"""Makes the products of any candidates' columns."""

_ROUNDS = 5
_ENOUGH = 0.02
"""nats; a smaller improvement ends the rounds."""
_SAME_DELAY = 0.01
"""Of a delay, to which forms are compared."""
_LEAST_DELAY, _LONGEST_DELAY = 1e-4, 0.1
"""s"""


def own_shapes(
    candidates: list[Candidate],
    spans: Sequence[tuple[Array, Array]],
    design: Design,
    weights: Array,
    pass_over: Pass,
) -> list[Candidate]:
    """The candidates at the shapes that their coefficients tell, within ``spans``; a delay in the best of its forms."""

    def model_of(trial: Sequence[Candidate]) -> tuple[Design, Conditional]:
        own, block = pass_over(trial)
        return own, within_limits(Weighted(own, block, weights), own.candidates)

    laws = [design.hypotheses[candidate.hypothesis].effect for candidate in candidates]
    if any(law.about for law in laws):
        candidates = _as_large(candidates, *model_of(candidates))
    if any(law.factored for law in laws):
        candidates = _at_one(candidates, spans, model_of)
    for number, candidate in enumerate(candidates):
        forms = _forms(design, candidate)
        if len(forms) > 1:
            candidates = _of_best_form(candidates, number, forms, model_of)
    return candidates


def _as_large(candidates: list[Candidate], design: Design, model: Conditional) -> list[Candidate]:
    """With columns of coefficients as large as theirs, whether these explain more or not: what those of small ones
    leave, another law may have mended."""
    shaped = shaped_by_coefficients(design, value_of(model), candidates)
    return [
        new if design.hypotheses[new.hypothesis].effect.about else old
        for new, old in zip(shaped, candidates, strict=True)
    ]


def _at_one(
    candidates: list[Candidate],
    spans: Sequence[tuple[Array, Array]],
    model_of: Callable[[Sequence[Candidate]], tuple[Design, Conditional]],
) -> list[Candidate]:
    """Those whose factor is one by right with the theta that it says, as long as that explains more: of a grid's shape
    it makes up for what the shape is not."""
    explained, trial = -np.inf, candidates
    for _ in range(_ROUNDS):
        own, model = model_of(trial)
        if model.explained < explained + _ENOUGH:
            break
        explained, candidates, value = model.explained, trial, value_of(model)
        trial = []
        for candidate, told, span in zip(candidates, own.candidates, spans, strict=True):
            theta = own.hypotheses[candidate.hypothesis].effect.at_one(candidate.theta, value[told.columns])
            trial.append(replace(candidate, theta=np.clip(theta, *span)))
    return candidates


def _forms(design: Design, candidate: Candidate) -> list[Array]:
    """Of a delay's grid one theta of each form."""
    hypothesis = design.hypotheses[candidate.hypothesis]
    if hypothesis.effect.timed(hypothesis.place) is None:
        return []
    grid = [c.theta for c in design.candidates if c.hypothesis == candidate.hypothesis]
    return list({tuple(theta[1:]): theta for theta in grid}.values())


def _of_best_form(
    candidates: list[Candidate],
    number: int,
    forms: Sequence[Array],
    model_of: Callable[[Sequence[Candidate]], tuple[Design, Conditional]],
) -> list[Candidate]:
    """With one of the candidates, a delay, in the form that explains most at the delay that it has in it: the delays of
    a grid differ by more than its forms do."""
    own, model = model_of(candidates)
    start = shaped_by_coefficients(own, value_of(model), candidates)[number].theta[0]
    best, result = -np.inf, candidates
    for form in forms:
        theta, trial = np.array([start, *form[1:]]), list(candidates)
        for _ in range(_ROUNDS):
            trial[number] = replace(candidates[number], theta=theta)
            own, model = model_of(trial)
            theta = shaped_by_coefficients(own, value_of(model), trial)[number].theta
            if abs(theta[0] - trial[number].theta[0]) < _SAME_DELAY * theta[0]:
                break
        if model.explained > best:
            best, result = model.explained, trial
    return result


def value_of(model: Conditional) -> Array:
    """(size of the design,) what the model has of each unknown: of those that it has not, nothing."""
    value = np.zeros(model.design.size)
    value[model.active] = model.value
    return value


def shaped_by_coefficients(design: Design, value: Array, candidates: Sequence[Candidate]) -> list[Candidate]:
    """The candidates, shaped for the coefficients that they have; those of a delay have the shape of what is late in
    all: the delay, and what the given model allows their channels' timings (a delay of a wrong shape is divided between
    the two)."""
    result = []
    for number, candidate in enumerate(candidates):
        hypothesis = design.hypotheses[candidate.hypothesis]
        sign = hypothesis.effect.timed(hypothesis.place)
        own = value[design.candidates[number].columns]
        theta = hypothesis.effect.exact_at(candidate.theta, own)
        if sign is not None:
            timings = value[design.base.rank + np.array(candidate.channels)]
            theta[0] = np.clip(float(own[0]) + sign * timings.mean(), _LEAST_DELAY, _LONGEST_DELAY)
        result.append(replace(candidate, theta=theta))
    return result
