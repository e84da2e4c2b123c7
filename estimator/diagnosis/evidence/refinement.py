"""The chosen causes once more, their non-linear parameters free: Gauss–Newton steps on Gram matrices."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.conditional import Conditional, within_limits
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.gathered import Evidence
from estimator.diagnosis.evidence.grams import Block, sum_up, total
from estimator.diagnosis.evidence.own_frictions import by_other_recordings
from estimator.diagnosis.evidence.own_shapes import own_shapes, shaped_by_coefficients, value_of
from estimator.diagnosis.evidence.scanning import scanned
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.noise import Noise
from estimator.diagnosis.observed.stretches import Stretch

Array = NDArray[np.float64]

_ITERATIONS = 16
_HALVINGS = 2
"""Of a step that does not improve, before the one before it is the last."""
_STEP = 1e-3
"""Of a non-linear parameter's span: step of the numerical derivative."""
_BEYOND = 0.1
"""Of a grid's span, how far beyond it the shape of a law that was sought between its shapes may go: it may stand at its
end."""
_LINES = 48
"""Lines of a spectrum to either side, beyond which one does not go."""
_ENOUGH = 0.02
"""nats; a smaller improvement ends the refinement."""


@dataclass(frozen=True)
class Refined:
    """The given model with its causes, all parameters free."""

    design: Design
    """With the chosen candidates alone, at their refined theta."""
    value: Array
    """(given + coefficients,) the given model's deviations, then each candidate's coefficients."""
    covariance: Array
    """(size + thetas, size + thetas): of ``value``, then each candidate's theta."""
    model: Conditional

    @property
    def explained(self) -> float:
        """nats above the given model's log-likelihood."""
        return self.model.explained

    def coefficients(self, candidate: int) -> Array:
        return np.asarray(self.value[self.design.candidates[candidate].columns])

    def only(self, numbers: Sequence[int]) -> Refined:
        """Some of the candidates, with what was told of them beside all; the model stays that of all."""
        kept = [self.design.candidates[k] for k in numbers]
        own = self.design.with_candidates(kept)
        columns = np.concatenate([np.arange(self.design.given), *(c.columns for c in kept)]).astype(np.intp)
        ends = np.cumsum([len(c.theta) for c in self.design.candidates])
        thetas = [
            self.design.size + np.arange(ends[k] - len(c.theta), ends[k]) for k, c in zip(numbers, kept, strict=True)
        ]
        places = np.concatenate([columns, *thetas]).astype(np.intp)
        return Refined(own, self.value[columns], self.covariance[np.ix_(places, places)], self.model)

    def covariance_of(self, candidate: int) -> Array:
        """Of [theta | coefficients] of one candidate."""
        own = self.design.candidates[candidate]
        before = sum(len(c.theta) for c in self.design.candidates[:candidate])
        places = [*(self.design.size + before + np.arange(len(own.theta))), *own.columns]
        chosen = np.array(places, dtype=np.intp)
        return np.asarray(self.covariance[np.ix_(chosen, chosen)])


def fitted(evidence: Evidence, scores: Scores, chosen: Sequence[int]) -> Refined:
    """The candidates at their best shapes, under the noise and the weights that they were chosen by."""
    return refine(evidence.design, chosen, evidence.pieces, evidence.decimations, evidence.noise, scores.weights)


def refine(
    design: Design,
    chosen: Sequence[int],
    pieces: Sequence[Stretch],
    decimations: Sequence[int],
    noise: Noise,
    weights: Array,
) -> Refined:
    """Improves theta of the chosen candidates within the span of their grids, and tells the errors of everything."""
    spans = [_span(design, k) for k in chosen]

    def pass_over(wanted: Sequence[Candidate]) -> tuple[Design, Block]:
        own = design.with_candidates(wanted)
        return own, total(sum_up(own, pieces, decimations, noise))

    candidates = own_shapes(scanned(design, chosen, weights, pass_over), spans, design, weights, pass_over)
    best: float = -np.inf
    step, halvings = np.zeros(0), 0
    trial = own_shaped = candidates
    for _ in range(_ITERATIONS):
        stepped = [*trial, *_neighbours(trial, spans)]
        wide, block = pass_over(stepped)
        model = within_limits(Weighted(wide, block, weights), wide.candidates[: len(trial)])
        gain = model.explained
        if gain < best + _ENOUGH and np.isfinite(best):
            if gain > best:
                candidates = trial
                break
            if halvings == _HALVINGS:
                break
            step, halvings = step / 2.0, halvings + 1
        else:
            best, candidates, halvings = gain, trial, 0
            step = _newton_step(wide, model, trial, spans)
            own_shaped = shaped_by_coefficients(wide, value_of(model), trial)
        trial = _moved(candidates, own_shaped, step, spans)
        if not any(np.any(np.abs(a.theta - b.theta) > 1e-9) for a, b in zip(trial, candidates, strict=True)):
            break
    wide, block = pass_over([*candidates, *_neighbours(candidates, spans)])
    size = design.given + sum(len(c.columns) for c in candidates)
    whole = Conditional(Weighted(wide, block, weights), np.arange(size))
    covariance = _covariance(wide, whole, candidates, spans)
    covariance[:size, :size] += by_other_recordings(whole)
    own, block = pass_over(candidates)
    model = within_limits(Weighted(own, block, weights), own.candidates)
    return Refined(own, value_of(model), covariance, model)


def _span(design: Design, candidate: int) -> tuple[Array, Array]:
    """Least and largest theta of a candidate's grid; what is a choice, a delay, or a coefficient has no span."""
    own = design.candidates[candidate]
    hypothesis = design.hypotheses[own.hypothesis]
    choices = [*([] if hypothesis.effect.timed(hypothesis.place) is None else [0]), *hypothesis.effect.choices]
    same = [c.theta for c in design.candidates if c.hypothesis == own.hypothesis]
    grid = np.array([theta for theta in same if np.array_equal(theta[choices], own.theta[choices])])
    low, high = grid.min(axis=0), grid.max(axis=0)
    about = list(hypothesis.effect.about)
    low[about] = high[about] = own.theta[about]
    if hypothesis.effect.recurs and len(grid) > 1:
        reach = _LINES * np.median(np.diff(np.sort(grid[:, 0])))
        low[0], high[0] = max(low[0], own.theta[0] - reach), min(high[0], own.theta[0] + reach)
    beyond = (_BEYOND if hypothesis.effect.sought else 0.0) * (high - low)
    return np.minimum(low, own.theta - beyond), np.maximum(high, own.theta + beyond)


def _widths(spans: Sequence[tuple[Array, Array]]) -> Array:
    """(thetas,) of all candidates one after the other; nothing where theta is not free."""
    return np.concatenate([high - low for low, high in spans]) if spans else np.zeros(0)


def _free(span: tuple[Array, Array]) -> list[int]:
    """Which of a candidate's theta have a span."""
    return [k for k, (low, high) in enumerate(zip(*span, strict=True)) if high > low]


def _neighbours(candidates: Sequence[Candidate], spans: Sequence[tuple[Array, Array]]) -> list[Candidate]:
    """Each candidate with each of its free theta a little larger (smaller at the upper end of the span)."""
    result = []
    for candidate, span in zip(candidates, spans, strict=True):
        for k in _free(span):
            theta = candidate.theta.copy()
            theta[k] += _shift(candidate, span, k)
            result.append(replace(candidate, theta=theta))
    return result


def _shift(candidate: Candidate, span: tuple[Array, Array], k: int) -> float:
    width = float(span[1][k] - span[0][k])
    return -_STEP * width if candidate.theta[k] + _STEP * width > span[1][k] else _STEP * width


def _slopes(
    design: Design, value: Array, candidates: Sequence[Candidate], spans: Sequence[tuple[Array, Array]]
) -> Array:
    """(free thetas, size of the wide design): what a unit of each theta adds, in terms of the wide design's columns."""
    result: list[Array] = []
    neighbour = len(candidates)
    for number, (candidate, span) in enumerate(zip(candidates, spans, strict=True)):
        own = design.candidates[number].columns
        for k in _free(span):
            row = np.zeros(design.size)
            row[design.candidates[neighbour].columns] = value[own]
            row[own] = -value[own]
            result.append(row / _shift(candidate, span, k))
            neighbour += 1
    return np.array(result).reshape(len(result), design.size)


def _information(design: Design, model: Conditional, slopes: Array) -> tuple[Array, Array, Array]:
    """Schur complement of theta after the linear unknowns, its score, and the linear unknowns' response."""
    everything = np.arange(design.size)
    whole = model.told.with_all(everything)
    cross = slopes @ whole[:, model.active]
    response = model.solve(cross.T)
    inner = slopes @ whole @ slopes.T - cross @ response
    score = slopes @ model.right - cross @ model.value
    return inner, score, response


def _newton_step(
    design: Design, model: Conditional, candidates: Sequence[Candidate], spans: Sequence[tuple[Array, Array]]
) -> Array:
    widths = _widths(spans)
    free, step = widths > 0.0, np.zeros(len(widths))
    if not free.any():
        return step
    inner, score, _ = _information(design, model, _slopes(design, value_of(model), candidates, spans))
    # A weak pull to where theta is, a span wide: what the data do not tell stays.
    step[free] = np.linalg.solve(inner + np.diag(1.0 / widths[free] ** 2), score)
    return np.asarray(np.clip(step, -0.5 * widths, 0.5 * widths))


def _moved(
    candidates: Sequence[Candidate], own_shaped: Sequence[Candidate], step: Array, spans: Sequence[tuple[Array, Array]]
) -> list[Candidate]:
    """The candidates a step on; what of their theta has no span is as ``own_shaped`` has it."""
    result, place = [], 0
    for candidate, shaped, (low, high) in zip(candidates, own_shaped, spans, strict=True):
        count = len(candidate.theta)
        theta = np.clip(candidate.theta + step[place : place + count], low, high)
        result.append(replace(candidate, theta=np.where(high > low, theta, shaped.theta)))
        place += count
    return result


def _covariance(
    design: Design, model: Conditional, candidates: Sequence[Candidate], spans: Sequence[tuple[Array, Array]]
) -> Array:
    """Of linear unknowns and theta together, by block inversion; a theta that the data do not tell keeps the variance
    of its span, and one without a span has no error."""
    size, widths = len(model.active), _widths(spans)
    result = np.zeros((size + len(widths), size + len(widths)))
    result[:size, :size] = model.covariance
    free = np.flatnonzero(widths > 0.0)
    if len(free):
        inner, _, response = _information(design, model, _slopes(design, value_of(model), candidates, spans))
        own = np.linalg.inv(inner + np.diag(12.0 / widths[free] ** 2))
        cross = -response @ own
        result[np.ix_(size + free, size + free)] = own
        result[:size, size + free] = cross
        result[size + free, :size] = cross.T
        result[:size, :size] -= cross @ response.T
    return result
