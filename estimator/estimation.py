"""Which unknowns the data support, with which weights, and their solution: small algebra on the sums."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from estimator.base_parameters import BaseParameters
from estimator.consistency import prior_precision
from estimator.normal_equations import (
    NormalEquations,
    Solution,
    assemble,
    excited,
    residual_autocovariance,
    solve,
    torque_power,
)
from estimator.rows import Layout
from estimator.sums import Sums
from estimator.terms import NEVER_NEGATIVE
from estimator.whitening import white_weight, whitening_weight

Array = NDArray[np.float64]

Estimator = Literal["least_squares", "weighted", "whitened", "instrumental_variables"]

_EXCITED = 1e-6
"""Share of a column's energy that no other column may explain away."""
_REWEIGHTINGS = 3


@dataclass(frozen=True)
class Prior:
    """What is believed of the inertial parameters beforehand, from CAD say."""

    parameters: Array
    """(10·n,) of bodies with mass, in the order of `RigidBody.prior`."""
    tolerance: float = 0.3
    """Relative standard deviation of masses, lengths squared and inertias alike (see `consistency.prior_precision`)."""


@dataclass(frozen=True)
class Estimate:
    """Chosen unknowns, their solution, and for instrumental variables the test against the same without instruments."""

    chosen: list[int]
    solution: Solution
    untold: list[int]
    """Base parameters that the motion does not tell: left out, or the prior's."""
    hausman: Hausman | None
    equations: NormalEquations
    """Of the chosen unknowns."""
    refused: dict[int, float]
    """Terms with a sign that nothing physical has, and the value they would have had."""


@dataclass(frozen=True)
class Hausman:
    """Durbin–Wu–Hausman test: do estimates with and without instruments differ by more than chance?

    When they do, noise in the measured motion biases the estimate without instruments.
    """

    p_value: float
    unknown: int
    """The unknown that differs most."""


def estimate(layout: Layout, sums: Sums, estimator: Estimator, select_terms: bool, prior: Prior | None) -> Estimate:
    """Solves for base parameters and terms; see `estimator.links.identify_links`."""
    by_instruments = estimator == "instrumental_variables"

    def equations_of(weights: Array, by_instruments: bool = False) -> NormalEquations:
        equations = assemble(layout, sums, weights, by_instruments)
        return equations if prior is None else _informed(equations, layout.base, prior)

    power = np.maximum(torque_power(layout, sums.batches), np.finfo(float).tiny)
    weights = np.array([white_weight(p) for p in power])
    equations = equations_of(weights)
    rank = layout.base.rank
    told = excited(assemble(layout, sums, weights), rank, _EXCITED)
    chosen = told if prior is None else [*range(rank), *(k for k in told if k >= rank)]
    chosen = _one_width_a_joint(layout, equations, chosen)

    def reweighted() -> Array:
        """Weights from the residuals of the weighted solution, a few times over."""
        result = weights
        for _ in range(_REWEIGHTINGS):
            now = equations_of(result).of(chosen)
            unknowns = np.zeros(layout.size)
            unknowns[chosen] = np.linalg.solve(now.total, now.total_right)
            result = _weights_of_residual(layout, sums, unknowns, len(chosen), estimator == "whitened")
        return result

    weights = np.array([white_weight(1.0)] * layout.body.n) if estimator == "least_squares" else reweighted()
    equations = equations_of(weights, by_instruments)
    refused: dict[int, float] = {}
    if select_terms:
        chosen, refused = _supported(layout, equations, chosen, sums.rows * layout.body.n)
        if estimator != "least_squares":
            weights = reweighted()
            equations = equations_of(weights, by_instruments)
    final = equations.of(chosen)
    solution = solve(final)
    hausman = _hausman(solution, solve(equations_of(weights).of(chosen)), chosen) if by_instruments else None
    return Estimate(chosen, solution, [k for k in range(rank) if k not in told], hausman, final, refused)


def _informed(equations: NormalEquations, base: BaseParameters, prior: Prior) -> NormalEquations:
    """Carries the prior of the full parameters over to their combinations."""
    spread = base.combination @ np.linalg.solve(prior_precision(prior.parameters, prior.tolerance), base.combination.T)
    return equations.with_prior(np.linalg.inv(spread), base.combination @ prior.parameters)


def _hausman(with_instruments: Solution, without: Solution, chosen: list[int]) -> Hausman | None:
    """Student's test of each difference, its error by leaving batches out, the smallest p-value times their number."""
    count = len(with_instruments.without)
    if count == 0:
        return None
    difference = with_instruments.value - without.value
    spread = with_instruments.without - without.without - difference
    error = np.sqrt((count - 1) / count * np.sum(spread**2, axis=0))
    p_values = 2.0 * student.sf(np.abs(difference) / error, count - 1)
    most = int(np.argmin(p_values))
    return Hausman(min(1.0, float(p_values[most]) * len(chosen)), chosen[most])


def _weights_of_residual(layout: Layout, sums: Sums, unknowns: Array, fitted: int, whiten: bool) -> Array:
    """(n, LAGS): one over each joint's residual variance, or its inverse spectrum."""
    covariance = residual_autocovariance(layout, sums.batches, unknowns)
    floor = 1e-14 * torque_power(layout, sums.batches) + np.finfo(float).tiny
    covariance[:, 0] = np.maximum(covariance[:, 0], floor)
    covariance *= sums.rows / max(1.0, sums.rows - fitted / layout.body.n)
    return np.array([whitening_weight(row, sums.rows) if whiten else white_weight(row[0]) for row in covariance])


def _one_width_a_joint(layout: Layout, equations: NormalEquations, chosen: list[int]) -> list[int]:
    """Of the friction sigmoids of a joint only the one that fits best, others as they are."""
    place = layout.base.rank
    total, right = equations.total, equations.total_right
    for terms in layout.terms:
        widths = [place + k for k, term in enumerate(terms) if term.name == "coulomb_friction"]
        place += len(terms)
        gain: dict[int, float] = {}
        for width in widths:
            if width in chosen:
                trial = [k for k in chosen if k not in widths or k == width]
                solution = np.linalg.solve(total[np.ix_(trial, trial)], right[trial])
                gain[width] = float(right[trial] @ solution)
        best = max(gain, key=lambda k: gain[k], default=-1)
        chosen = [k for k in chosen if k not in widths or k == best]
    return chosen


def _supported(
    layout: Layout, equations: NormalEquations, chosen: list[int], rows: int
) -> tuple[list[int], dict[int, float]]:
    """Drops terms, the least supported first, until each one's squared t-value exceeds log(rows); then those whose sign
    is impossible, the worst first, until there is none. Returns what is left, and what was refused with its value.

    The threshold is the Bayesian information criterion with the colour of the noise in the standard errors.
    """
    threshold = np.log(rows)
    all_terms = [term for terms in layout.terms for term in terms]
    refused: dict[int, float] = {}
    while True:
        solution = solve(equations.of(chosen))
        terms = [(k, j) for j, k in enumerate(chosen) if k >= layout.base.rank]
        support = {k: float(solution.value[j] ** 2 / solution.covariance[j, j]) for k, j in terms}
        weakest = min(support, key=lambda k: support[k], default=-1)
        if weakest >= 0 and support[weakest] <= threshold:
            chosen = [k for k in chosen if k != weakest]
            continue
        impossible = {
            k: float(solution.value[j])
            for k, j in terms
            if all_terms[k - layout.base.rank].name in NEVER_NEGATIVE and solution.value[j] < 0.0
        }
        worst = max(impossible, key=lambda k: support[k], default=-1)
        if worst < 0:
            return chosen, refused
        refused[worst] = impossible[worst]
        chosen = [k for k in chosen if k != worst]
