"""Whether what a model leaves of a torque still depends on something: a test of its fit that names no law.

Every map is asked in its smoothest direction, its two smoothest, and so on; the most surprising depth counts, so that a
bent law is not lost among the many forms that a map could take (data-driven smooth tests; Ledwina 1994).
"""

from __future__ import annotations

from collections import defaultdict
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import cholesky, solve_triangular
from scipy.special import chdtrc

from estimator.diagnosis.evidence.maps import smoothest_first
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import FALSE_ALARM, LEAST_SEEN, RECURRING

Array = NDArray[np.float64]

_DEPTHS = 3.0
"""As many independent tests behave like all depths of one map: each holds those before it."""
_TOLD = 1e-9
"""Share of a column's energy that each keeps at least: what the model has taken of it whole is no surprise."""


@dataclass(frozen=True)
class Misfit:
    """The most surprising dependence of one channel's residual."""

    candidate: int
    """The map."""
    variance: float
    """Mean square that it explains, in the noise's variance."""
    false_alarm: float
    """Probability that chance makes any map of its family as surprising: those that show the forms of the laws that
    were chosen, or all."""
    recurring: float = 1.0
    """How much of it is there with angles that have other errors (`Scores.recurring`)."""

    @property
    def told(self) -> bool:
        """Whether it is beyond chance, no smaller than the noise is known, and none of the noise itself."""
        return self.false_alarm <= FALSE_ALARM and self.variance > LEAST_SEEN and self.recurring > RECURRING


def misfits(scores: Scores, chosen: list[int]) -> dict[int, Misfit]:
    """By channel, what the chosen candidates leave to a map."""
    maps = [int(k) for k in np.flatnonzero(scores.is_map[scores.owner])]
    forms = _forms_of(scores, maps, chosen)
    model, design = scores.model(chosen), scores.design
    found: dict[int, list[Misfit]] = defaultdict(list)
    for k in maps:
        matrix, score, energy = model.left_of(design.candidates[k].columns)
        surprise, gain = _surprise(matrix, score, energy)
        (channel,) = design.candidates[k].channels
        asked = len(forms) if k in forms else len(maps)
        chance = -np.expm1(-asked * _DEPTHS * np.exp(-surprise))
        variance = 2.0 * gain / (scores.weights[channel] * scores.total.rows)
        found[channel].append(Misfit(k, float(variance), float(chance)))
    return {channel: _most_surprising(scores, chosen, own) for channel, own in found.items()}


def _forms_of(scores: Scores, maps: list[int], chosen: list[int]) -> set[int]:
    """The maps against which the laws that were chosen show their form. They are asked as a family of their own: a
    known law of another form is what a residual there is first of all."""
    laws = [(scores.hypothesis(k), scores.design.candidates[k].theta) for k in chosen]
    seen = {(law.place, against) for law, theta in laws if (against := law.effect.seen_at(theta)) != "law"}
    return {k for k in maps if ((own := scores.hypothesis(k)).place, own.effect.seen_against) in seen}


def left_to_see(scores: Scores, chosen: list[int]) -> Array:
    """(channels,) of the noise's variance, what the chosen candidates leave that is told of a map."""
    left = np.zeros(len(scores.design.channels))
    for channel, misfit in misfits(scores, chosen).items():
        left[channel] = misfit.variance if misfit.told else 0.0
    return left


def _most_surprising(scores: Scores, chosen: list[int], found: list[Misfit]) -> Misfit:
    """The first of those that are told, else the first."""
    ranked = sorted(found, key=lambda misfit: misfit.false_alarm)
    for misfit in (m for m in ranked if m.told):
        judged = replace(misfit, recurring=scores.recurring(misfit.candidate, chosen))
        if judged.told:
            return judged
    return replace(ranked[0], recurring=0.0) if ranked[0].told else ranked[0]


def _surprise(matrix: Array, score: Array, energy: Array) -> tuple[float, float]:
    """The largest −log probability of a map's gain under chance over all depths, and that depth's gain in nats.

    ``matrix`` (c, c) products of its columns after the model's, ``score`` (c,) those with the residual, ``energy`` (c,)
    squared norms before.
    """
    shapes = smoothest_first(len(score))
    matrix, score, energy = shapes.T @ matrix @ shapes, shapes.T @ score, np.square(shapes).T @ energy
    scale = 1.0 / np.sqrt(np.maximum(energy, np.finfo(float).tiny))
    # The factor of the whole holds that of every depth.
    factor = cholesky(matrix * np.outer(scale, scale) + _TOLD * np.eye(len(score)), lower=True)
    squares = np.cumsum(solve_triangular(factor, score * scale, lower=True) ** 2)
    with np.errstate(divide="ignore"):
        surprises = -np.log(chdtrc(1.0 + np.arange(len(score)), squares))
    depth = int(np.argmax(surprises))
    return float(surprises[depth]), float(0.5 * squares[depth])
