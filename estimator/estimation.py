"""Which unknowns the data support, with which weights, and their solution: small algebra on the sums."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from estimator.base_parameters import BaseParameters
from estimator.column_noise import motion_noise_autocovariance, without_column_noise
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

Estimator = Literal[
    "least_squares",
    "weighted",
    "whitened",
    "instrumental_variables",
    "total_least_squares",
    "optimal_filter",
    "maximum_likelihood",
]
OF_NOISE: tuple[Estimator, ...] = ("total_least_squares", "optimal_filter", "maximum_likelihood")
"""Estimators that know the noise in the regressor's columns."""

_EXCITED = 1e-6
"""Share of a column's energy that no other column may explain away."""
_REWEIGHTINGS = 3
_DRAWS = 10_000
"""Of the largest difference in the Durbin–Wu–Hausman test."""
_LEAST_TORQUE_NOISE = 0.05
"""Share of the residual that is white at least."""


@dataclass(frozen=True)
class Prior:
    """What is believed of the inertial parameters beforehand, from CAD say."""

    parameters: Array
    """(10·n,) of bodies with mass, in the order of `RigidBody.prior`."""
    tolerance: float = 0.3
    """Relative standard deviation of masses, lengths squared and inertias alike (see `consistency.prior_precision`)."""


@dataclass(frozen=True)
class KnownNoise:
    """What is known of the noise beside the residual."""

    columns: list[Array]
    """Of `estimator.column_noise.column_noise`."""
    from_repeats: Callable[[Array], Array | None]
    """(n, LAGS) autocovariance of the rows' pure error at given unknowns (P,); None where no motion recurs."""


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
    owners: tuple[int, ...]
    """The recording of each batch of the equations."""
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


def estimate(
    layout: Layout,
    sums: Sums,
    estimator: Estimator,
    select_terms: bool,
    prior: Prior | None,
    noise: KnownNoise | None = None,
) -> Estimate:
    """Solves for base parameters and terms; see `estimator.links.identify_links`. ``noise`` for those `OF_NOISE`.

    For ``maximum_likelihood`` it is where that starts (`estimator.maximum_likelihood`): the optimal filter's.
    """
    by_instruments = estimator == "instrumental_variables"
    by_filter = estimator in ("optimal_filter", "maximum_likelihood")
    rank = layout.base.rank

    def equations_of(weights: Array, by_instruments: bool = False) -> NormalEquations:
        equations = assemble(layout, sums, weights, by_instruments)
        return equations if prior is None else _informed(equations, layout.base, prior)

    def system(weights: Array, by_instruments: bool = False) -> NormalEquations:
        equations = equations_of(weights, by_instruments).of(chosen)
        if noise is None:
            return equations
        return without_column_noise(layout, sums, equations, chosen, noise.columns, weights)

    def reweighted() -> Array:
        """Weights from the solution before, a few times over."""
        if estimator == "least_squares":
            return np.array([white_weight(1.0)] * layout.body.n)
        result = weights
        for _ in range(_REWEIGHTINGS):
            now = system(result)
            unknowns = np.zeros(layout.size)
            unknowns[chosen] = np.linalg.solve(now.total, now.total_right)
            covariance = _residual_covariance(layout, sums, unknowns, len(chosen))
            if by_filter and noise is not None:
                covariance = _noise_covariance(layout, covariance, noise, unknowns)
            coloured = by_filter or estimator == "whitened"
            result = np.array([whitening_weight(c, sums.rows) if coloured else white_weight(c[0]) for c in covariance])
        return result

    power = np.maximum(torque_power(layout, sums.batches), np.finfo(float).tiny)
    weights = np.array([white_weight(p) for p in power])
    told = excited(assemble(layout, sums, weights), rank, _EXCITED)
    chosen = told if prior is None else [*range(rank), *(k for k in told if k >= rank)]
    chosen = _one_width_a_joint(layout, equations_of(weights), chosen)
    weights = reweighted()
    refused: dict[int, float] = {}
    if select_terms:
        chosen, refused = _supported(layout, equations_of(weights, by_instruments), chosen, sums.rows * layout.body.n)
        weights = reweighted()
    final = system(weights, by_instruments)
    solution = solve(final)
    hausman = None
    if by_instruments:
        without = solve(system(weights))
        solution = replace(solution, degrees_of_freedom=without.degrees_of_freedom)
        hausman = _hausman(solution, without, chosen)
    owners = tuple(batch.recording for batch in sums.batches)
    return Estimate(chosen, solution, [k for k in range(rank) if k not in told], hausman, final, owners, refused)


def _informed(equations: NormalEquations, base: BaseParameters, prior: Prior) -> NormalEquations:
    """Carries the prior of the full parameters over to their combinations."""
    spread = base.combination @ np.linalg.solve(prior_precision(prior.parameters, prior.tolerance), base.combination.T)
    return equations.with_prior(np.linalg.inv(spread), base.combination @ prior.parameters)


def _hausman(with_instruments: Solution, without: Solution, chosen: list[int]) -> Hausman | None:
    """Student's test of the difference that stands out most, its error by leaving batches out.

    That it is the largest of many is accounted for by drawing the largest of as many differences with the same
    correlations; where it is too rare to be drawn, by its p-value times their number (Bonferroni), never less.
    """
    count = len(with_instruments.without)
    if count == 0:
        return None
    difference = with_instruments.value - without.value
    spread = with_instruments.without - without.without - difference
    error = np.sqrt((count - 1) / count * np.sum(spread**2, axis=0))
    ratio = np.abs(difference) / error
    most = int(np.argmax(ratio))
    alone = 2.0 * float(student.sf(ratio[most], count - 1))
    random = np.random.default_rng(0)
    batches = np.sqrt((count - 1) / count) * spread / error
    drawn = np.abs(random.normal(size=(_DRAWS, count)) @ batches).max(axis=1)
    drawn /= np.sqrt(random.chisquare(count - 1, _DRAWS) / (count - 1))
    as_large = (1.0 + np.count_nonzero(drawn >= ratio[most])) / (1.0 + _DRAWS)
    return Hausman(min(1.0, as_large, alone * len(chosen)), chosen[most])


def _residual_covariance(layout: Layout, sums: Sums, unknowns: Array, fitted: int) -> Array:
    """(n, LAGS) autocovariance of each joint's residual, for what the fit has taken of it."""
    covariance = residual_autocovariance(layout, sums.batches, unknowns)
    floor = 1e-14 * torque_power(layout, sums.batches) + np.finfo(float).tiny
    covariance[:, 0] = np.maximum(covariance[:, 0], floor)
    return np.asarray(covariance * (sums.rows / max(1.0, sums.rows - fitted / layout.body.n)))


def _noise_covariance(layout: Layout, residual: Array, noise: KnownNoise, unknowns: Array) -> Array:
    """(n, LAGS) that an optimal filter divides by (Eq. 5.49): the colour of the noise alone, from the pure error where
    motion recurs, else from the motion's noise carried through the model; and white for what the residual has beyond.
    What the model lacks is then not mistaken for coloured noise, which would take the weight away from where it moves.
    """
    repeated = noise.from_repeats(unknowns)
    coloured = motion_noise_autocovariance(layout, noise.columns, unknowns) if repeated is None else repeated
    coloured[:, 0] += np.maximum(residual[:, 0] - coloured[:, 0], _LEAST_TORQUE_NOISE * residual[:, 0])
    return coloured


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
