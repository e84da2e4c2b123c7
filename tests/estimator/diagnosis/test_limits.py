"""A model fitted within the limits of its causes, against non-negative least squares."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import nnls

from estimator import RigidBody
from estimator.base_parameters import base_parameters
from estimator.diagnosis.evidence.conditional import within_limits
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.judging import _beyond_nothing
from estimator.diagnosis.naming.plainer import _as_named
from estimator.diagnosis.observed.stretches import Channel
from estimator.effects import catalogue

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def design(make_chain: Callable[..., RigidBody]) -> Design:
    """One joint's torque, and two laws of two coefficients each that are not negative; the given model is certain."""
    body = make_chain("r")
    base = base_parameters(body)
    given = base.rank + 1
    zero, free = np.zeros(2), np.full(2, np.inf)
    laws = tuple(Candidate(k, np.zeros(0), given + 2 * k + np.arange(2), (0,), zero, free) for k in range(2))
    reached = (np.arange(base.rank),)
    return Design(body, base, (Channel("torque", 0),), (), laws, 1e12 * np.eye(given), reached)


def rows_of(design: Design, truth: Array) -> tuple[Array, Array, Block]:
    random = np.random.default_rng(7)
    columns = random.normal(size=(design.size, 200))
    residual = truth @ columns[design.given :] + random.normal(size=200)
    whole = np.vstack([columns, residual])
    return columns[design.given :], residual, Block(0, 200, [whole @ whole.T])


@pytest.mark.parametrize("truth", [[2.0, -1.0, 0.5, 3.0], [2.0, -1.0, -0.5, 3.0], [-2.0, -1.0, 0.5, -3.0]])
def test_parts_of_the_wrong_sign_are_not_there(design: Design, truth: list[float]) -> None:
    columns, residual, block = rows_of(design, np.array(truth))
    model = within_limits(Weighted(design, block, np.ones(1)), design.candidates)
    value = np.zeros(design.size)
    value[model.active] = model.value
    np.testing.assert_allclose(value[design.given :], nnls(columns.T, residual)[0], atol=1e-5)
    assert (value[design.given :][np.array(truth) < 0.0] == 0.0).all()


def test_a_law_of_the_wrong_sign_keeps_what_it_is_refused_for(design: Design) -> None:
    _, _, block = rows_of(design, np.array([-2.0, -1.0, 0.5, 3.0]))
    model = within_limits(Weighted(design, block, np.ones(1)), design.candidates, least=1)
    kept = model.active[design.given :] - design.given
    assert list(kept) == [1, 2, 3], "the one farther beyond goes first"
    assert model.value[design.given] < -0.5
    assert len(within_limits(Weighted(design, block, np.ones(1)), design.candidates).active) == design.given + 2


def test_a_payload_without_mass_is_no_payload(design: Design) -> None:
    """Of a law with free coefficients beside a limited one, none goes where a law must stay whole."""
    _, _, block = rows_of(design, np.array([-2.0, 4.0, 0.5, 3.0]))
    lower = np.array([0.0, -np.inf])
    laws = [replace(design.candidates[0], lower=lower), design.candidates[1]]
    assert len(within_limits(Weighted(design, block, np.ones(1)), laws, least=1).active) == design.size
    assert len(within_limits(Weighted(design, block, np.ones(1)), laws).active) == design.size - 1


def test_what_a_law_is_named_for_stays(design: Design) -> None:
    """A friction that drifts to less than nothing is refused: without its end it is no drift."""
    _, _, block = rows_of(design, np.array([2.0, -1.0, 0.5, 3.0]))
    laws = [replace(design.candidates[0], named_for=(0, 1)), design.candidates[1]]
    assert len(within_limits(Weighted(design, block, np.ones(1)), laws, least=1).active) == design.size
    laws[0] = replace(laws[0], named_for=(0,))
    assert len(within_limits(Weighted(design, block, np.ones(1)), laws, least=1).active) == design.size - 1


@pytest.mark.parametrize(("correlation", "expected"), [(0.0, 5.0), (-0.96, np.sqrt(48.04 / 0.0784))])
def test_a_cause_differs_from_nothing_by_all_its_coefficients(correlation: float, expected: float) -> None:
    """Whatever their units; the first row is a theta's."""
    error = np.array([1.0, 1e-3, 1e3])
    shape = np.eye(3)
    shape[1, 2] = shape[2, 1] = correlation
    refined: Any = SimpleNamespace(
        coefficients=lambda _: np.array([3e-3, 4e3]), covariance_of=lambda _: shape * np.outer(error, error)
    )
    assert _beyond_nothing(refined, 0) == pytest.approx(expected)


@pytest.mark.parametrize(("rise", "expected"), [(0.08, 0.0), (0.12, 12.0)])
def test_a_part_of_a_few_per_cent_is_a_form_of_the_rest(rise: float, expected: float) -> None:
    """Stribeck friction of level 1, that rises by so much at rest, to a hundredth."""
    design = SimpleNamespace(
        candidates=[SimpleNamespace(hypothesis=0, theta=np.array([0.01, 2.0, 0.001]))],
        hypotheses=[SimpleNamespace(effect=catalogue()["stribeck_friction"])],
    )
    refined: Any = SimpleNamespace(
        design=design,
        coefficients=lambda _: np.array([1.0, rise, 0.5]),
        covariance_of=lambda _: np.diag([1e-4, 1e-4, 1e-4, 1e-4]),
    )
    assert _as_named(refined, 0) == pytest.approx(expected)
