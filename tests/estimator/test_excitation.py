"""Designed motions: exact slopes, limits that hold, more told than by any motion of the same length."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, base_parameters
from estimator.excitation import (
    Information,
    MotionBasis,
    MotionLimits,
    design,
    fourier_basis,
    polynomial_basis,
    random_motion,
)

Array = NDArray[np.float64]


def limits_of(body: RigidBody) -> MotionLimits:
    n = body.n
    return MotionLimits(
        np.full(n, -2.0), np.full(n, 2.5), np.full(n, 2.0), np.full(n, 6.0), np.full(n, 500.0), body.prior()
    )


def information_of(body: RigidBody, known: Array | None = None) -> Information:
    base = base_parameters(body)
    return Information(body, base, np.linspace(1.0, 0.3, body.n), 100.0, known, np.full(base.rank, 100.0))


@pytest.fixture(scope="module", params=["rrp", "crr"])
def arm(request: pytest.FixtureRequest, make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain(request.param, aligned=False)


def check_slopes(value: Callable[..., tuple[float, tuple[Array, ...]]], motion: list[Array]) -> None:
    """Against central differences, along random directions of q, of dq and of ddq."""
    random = np.random.default_rng(7)
    _, exact = value(*motion)
    for k in range(3):
        for _ in range(3):
            way = random.normal(size=motion[k].shape)
            ahead, behind = (
                value(*[x + (step * way if j == k else 0.0) for j, x in enumerate(motion)])[0] for step in (1e-5, -1e-5)
            )
            assert np.sum(exact[k] * way) == pytest.approx((ahead - behind) / 2e-5, rel=1e-5, abs=1e-7)


def test_slope_of_the_determinant_is_exact(arm: RigidBody) -> None:
    random = np.random.default_rng(1)
    information, motion = information_of(arm), [random.normal(size=(40, arm.n)) for _ in range(3)]
    check_slopes(lambda *states: information.log_determinant(*states, seconds=4.0), motion)


def test_slope_of_the_penalty_is_exact(arm: RigidBody) -> None:
    tight = MotionLimits(
        np.full(3, -0.5), np.full(3, 0.7), np.full(3, 0.5), np.full(3, 0.8), np.full(3, 30.0), arm.prior(), 0.4,
        ((0.1, 0.2, 0.3),),
    )  # fmt: skip
    random = np.random.default_rng(2)
    motion = [random.normal(size=(15, 3)) for _ in range(3)]
    assert tight.penalty(arm, *motion)[0] > 0.0
    check_slopes(lambda *states: tight.penalty(arm, *states), motion)


@pytest.mark.parametrize("basis", [fourier_basis(0.2, 3, 60), polynomial_basis([1.0, 0.8, 1.2], 7, 200)])
def test_bases_are_consistent(basis: MotionBasis) -> None:
    """Derivatives are those of the motion, and standing still is in it."""
    coefficients = np.random.default_rng(3).normal(size=(len(basis.centre), 2))
    q, dq, ddq = basis.motion(coefficients)
    step = basis.t[1] - basis.t[0]
    np.testing.assert_allclose((q[2:] - q[:-2]) / (2 * step), dq[1:-1], atol=0.05 * np.abs(dq).max())
    np.testing.assert_allclose((dq[2:] - dq[:-2]) / (2 * step), ddq[1:-1], atol=0.08 * np.abs(ddq).max())
    still, *rest = basis.motion(basis.towards_centre(coefficients, 0.0))
    np.testing.assert_allclose(still, np.tile(still[0], (len(q), 1)), atol=1e-12)
    assert np.abs(np.stack(rest)).max() < 1e-9


@pytest.mark.parametrize("family", ["fourier", "polynomial"])
def test_design_keeps_the_limits_and_beats_random_motions(dda: RigidBody, family: str) -> None:
    basis = fourier_basis(0.2, 4, 50) if family == "fourier" else polynomial_basis([1.2] * 5, 5, 60)
    information, limits = information_of(dda), limits_of(dda)
    best = design(information, basis, limits, seconds=10.0, seed=4, starts=1)
    again = design(information, basis, limits, seconds=10.0, seed=4, starts=1)
    np.testing.assert_array_equal(best.coefficients, again.coefficients)
    assert best.use <= 1.0
    assert limits.worst(dda, *basis.motion(best.coefficients)) == best.use
    rivals = [random_motion(information, basis, limits, 10.0, seed) for seed in range(10)]
    assert all(rival.use <= 1.0 for rival in rivals)
    assert best.log_determinant > max(rival.log_determinant for rival in rivals) + 3.0
    assert best.standard_errors.max() < min(rival.standard_errors.max() for rival in rivals)


def test_what_is_known_already_is_not_asked_for(dda: RigidBody) -> None:
    """With all but the third link known, a design for what is left; it tells more of it than any random motion."""
    base = base_parameters(dda)
    third = np.array(["3" in name.split()[0] for name in base.names])
    information = information_of(dda, np.diag(np.where(third, 1e-4, 1e10)))
    basis, limits = fourier_basis(0.2, 2, 30), limits_of(dda)
    best = design(information, basis, limits, 5.0, seed=1, starts=1)
    rivals = [random_motion(information, basis, limits, 5.0, seed) for seed in range(10)]
    assert best.log_determinant > max(rival.log_determinant for rival in rivals) + 3.0
    np.testing.assert_allclose(best.standard_errors[~third], 1e-5, rtol=0.05)
    assert best.standard_errors[third].max() < min(rival.standard_errors[third].max() for rival in rivals)


def test_limits_that_allow_nothing_are_named(dda: RigidBody) -> None:
    weak = replace(limits_of(dda), torque=np.full(3, 1e-3))
    with pytest.raises(InputError, match="torque limits"):
        design(information_of(dda), fourier_basis(0.2, 2, 30), weak, 5.0)
