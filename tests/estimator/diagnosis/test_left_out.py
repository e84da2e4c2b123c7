"""The worth of a cause on rows left out, against the marginal likelihood of Gaussian rows written out in full."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.stats import multivariate_normal

from estimator import RigidBody
from estimator.base_parameters import base_parameters
from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block, total, without_each
from estimator.diagnosis.evidence.left_out import gains_carried_over, gains_left_out, log_evidence, unit_information
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.observed.stretches import Channel

Array = NDArray[np.float64]

ROWS, FOLDS = 30, 3


@pytest.fixture(scope="module")
def design(make_chain: Callable[..., RigidBody]) -> Design:
    """One joint's torque and one candidate of two columns; the first base parameter is told by nothing beforehand."""
    body = make_chain("r")
    base = base_parameters(body)
    given = base.rank + 1
    free = np.full(2, np.inf)
    candidate = Candidate(0, np.zeros(0), given + np.arange(2), (0,), -free, free)
    precision = np.diag(np.append(1e-6, np.ones(given - 1)))
    reached = (np.arange(base.rank),)
    return Design(body, base, (Channel("torque", 0),), (), (candidate,), precision, reached)


@pytest.fixture
def rows(design: Design) -> Array:
    """(unknowns + 1, rows), the residual last. The free parameter shows in the last fold alone."""
    random = np.random.default_rng(3)
    columns = random.normal(size=(design.size, ROWS))
    columns[0, : ROWS - ROWS // FOLDS] *= 1e-6
    truth = np.append(0.5 * random.normal(size=design.given), [0.7, 0.0])
    truth[0] = 40.0
    return np.vstack([columns, truth @ columns + random.normal(size=ROWS)])


def models(design: Design, rows: Array) -> tuple[Conditional, list[Conditional]]:
    parts = np.split(rows, FOLDS, axis=1)
    blocks = [Block(0, part.shape[1], [part @ part.T]) for part in parts]
    whole = total(blocks)
    active = np.arange(design.given)
    sums = [whole, *without_each(whole, blocks, range(FOLDS))]
    first, *others = (Conditional(Weighted(design, block, np.ones(1)), active) for block in sums)
    return first, others


def marginal(design: Design, rows: Array, coefficients: Array | None) -> float:
    """log p(residual), every unknown integrated out; ``coefficients`` (2, 2) their prior covariance."""
    x, y = rows[: design.given], rows[-1]
    covariance = np.eye(rows.shape[1]) + x.T @ np.linalg.solve(design.precision, x)
    if coefficients is not None:
        columns = rows[design.given : -1]
        covariance += columns.T @ coefficients @ columns
    return float(multivariate_normal(np.zeros(len(y)), covariance).logpdf(y))


def test_evidence_is_the_ratio_of_marginal_likelihoods(design: Design, rows: Array) -> None:
    whole, _ = models(design, rows)
    columns = design.candidates[0].columns
    prior = unit_information(whole, columns)
    expected = marginal(design, rows, prior @ prior.T) - marginal(design, rows, None)
    assert log_evidence(whole, columns, prior) == pytest.approx(expected, abs=1e-5)


def test_evidence_tells_what_the_given_model_is_known_to(design: Design, rows: Array) -> None:
    whole, _ = models(design, rows)
    other = design.believed(25.0 * design.precision)
    expected = marginal(other, rows, None) - marginal(design, rows, None)
    known = Conditional(whole.told.believed(other.precision), whole.active)
    assert known.log_evidence - whole.log_evidence == pytest.approx(expected, abs=1e-5)


def test_left_out_rows_are_predicted_by_those_that_stay(design: Design, rows: Array) -> None:
    """A fold in which a parameter shows that no other fold tells is predicted widely, not wrongly."""
    whole, staying = models(design, rows)
    columns = design.candidates[0].columns
    prior = unit_information(whole, columns)
    covariance = prior @ prior.T
    found = gains_left_out(whole, staying, columns)
    for fold, gain in enumerate(found):
        stay = np.delete(rows, np.arange(ROWS // FOLDS) + fold * (ROWS // FOLDS), axis=1)
        with_it, without = (marginal(design, rows, c) - marginal(design, stay, c) for c in (covariance, None))
        assert gain == pytest.approx(with_it - without, abs=1e-5)
    assert found.sum() > 0.0


def test_the_prior_of_coefficients_has_no_scale(design: Design, rows: Array) -> None:
    columns = design.candidates[0].columns
    mixed = rows.copy()
    mixed[columns] = np.array([[1e6, 0.0], [3e-4, 1e-4]]) @ rows[columns]
    one, other = (gains_left_out(*models(design, x), columns) for x in (rows, mixed))
    np.testing.assert_allclose(one, other, rtol=1e-6)


def test_a_column_that_the_given_model_has_adds_nothing(design: Design, rows: Array) -> None:
    twin = rows.copy()
    twin[design.candidates[0].columns] = rows[1] * np.array([[1.0], [-2.0]])
    loose = Design(
        design.body, design.base, design.channels, (), design.candidates, 1e-14 * np.eye(design.given), design.reached
    )
    np.testing.assert_allclose(gains_left_out(*models(loose, twin), design.candidates[0].columns), 0.0, atol=1e-9)


def test_what_bends_anew_in_every_fold_is_predicted_by_the_cause_alone(design: Design, rows: Array) -> None:
    """Rows of which the given model's unknowns are others in each fold, and the cause's the same."""
    whole, _ = models(design, rows)
    columns = design.candidates[0].columns
    covariance = unit_information(whole, columns)
    covariance = covariance @ covariance.T
    blocks = [Block(0, part.shape[1], [part @ part.T]) for part in np.split(rows, FOLDS, axis=1)]
    parts = list(zip(without_each(total(blocks), blocks, range(FOLDS)), blocks, strict=True))
    found = gains_carried_over(design, parts, np.ones(1), whole, columns)
    told = rows[columns].T @ covariance @ rows[columns]
    bent = np.eye(ROWS) + rows[: design.given].T @ np.linalg.solve(design.precision, rows[: design.given])
    for fold, gain in enumerate(found):
        out = np.isin(np.arange(ROWS), np.arange(ROWS // FOLDS) + fold * (ROWS // FOLDS))
        apart = np.where(out[:, None] == out, bent, 0.0)
        expected = (
            _log_density(apart + told, rows[-1])
            - _log_density((apart + told)[np.ix_(~out, ~out)], rows[-1, ~out])
            - _log_density(apart[np.ix_(out, out)], rows[-1, out])
        )
        assert gain == pytest.approx(expected, abs=1e-5)


def test_a_model_bent_once_and_for_all_predicts_as_well_as_the_cause(design: Design, rows: Array) -> None:
    """The cause's column is one that the given model has, eight standard deviations beyond its tolerance."""
    twin = rows.copy()
    twin[design.candidates[0].columns] = rows[1], np.zeros(ROWS)
    twin[-1] = 8.0 * rows[1] + np.random.default_rng(5).normal(size=ROWS)
    whole, staying = models(design, twin)
    columns = design.candidates[0].columns
    blocks = [Block(0, part.shape[1], [part @ part.T]) for part in np.split(twin, FOLDS, axis=1)]
    parts = list(zip(without_each(total(blocks), blocks, range(FOLDS)), blocks, strict=True))
    carried = gains_carried_over(design, parts, np.ones(1), whole, columns)
    assert np.all(carried > 5.0)
    assert gains_left_out(whole, staying, columns).sum() < 0.2 * carried.sum()


def _log_density(covariance: Array, x: Array) -> float:
    return float(multivariate_normal(np.zeros(len(x)), covariance).logpdf(x))
