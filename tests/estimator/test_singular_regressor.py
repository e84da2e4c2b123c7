"""Ridge regression and singular values on the thesis' 600 samples."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, base_parameters, inverse_dynamics, torque_regressor
from estimator.singular_regressor import ridge_regression, smallest_nonzero_eigenvalue, svd_regression

Array = NDArray[np.float64]


@pytest.fixture(scope="module")
def samples(thesis_motions: list[tuple[Array, ...]]) -> list[Array]:
    """Two hundred samples of each motion: q, dq, ddq (600, 3)."""
    rows = np.linspace(300, 1600, 200).astype(int)
    return [np.concatenate([motion[k][rows] for motion in thesis_motions]) for k in (1, 2, 3)]


def test_ridge_agrees_with_the_reduced_set(dda: RigidBody, samples: list[Array]) -> None:
    regressor, base = torque_regressor(dda, *samples), base_parameters(dda)
    tau = inverse_dynamics(dda, dda.prior(), *samples)
    tau = tau + np.random.default_rng(0).normal(0.0, 0.5, tau.shape)
    reduced = np.linalg.lstsq(base.select(regressor).reshape(-1, 15), tau.reshape(-1), rcond=None)[0]
    psi = ridge_regression(regressor, tau, d=1e-6)
    np.testing.assert_allclose(base.combination @ psi, reduced, atol=1e-5)
    unidentifiable = [dda.parameter_names.index(name) for name in base.absent]
    np.testing.assert_allclose(psi[unidentifiable], 0.0, atol=1e-6)


def test_singular_values_are_where_the_ridge_tends_to(dda: RigidBody, samples: list[Array]) -> None:
    regressor, base = torque_regressor(dda, *samples), base_parameters(dda)
    tau = inverse_dynamics(dda, dda.prior(), *samples)
    tau = tau + np.random.default_rng(0).normal(0.0, 0.5, tau.shape)
    prior = 1.3 * dda.prior()
    psi = svd_regression(regressor, tau, base.rank, prior)
    near, far = (np.abs(ridge_regression(regressor, tau, d, prior) - psi).max() for d in (0.1, 10.0))
    assert far < 0.01 * np.abs(prior).max()
    assert near < 0.02 * far
    unseen = np.linalg.svd(regressor.reshape(-1, 30))[2][base.rank :]
    np.testing.assert_allclose(unseen @ psi, unseen @ prior, atol=1e-9)


def test_ridge_keeps_what_only_the_prior_knows(dda: RigidBody, samples: list[Array]) -> None:
    regressor = torque_regressor(dda, *samples)
    tau = inverse_dynamics(dda, dda.prior(), *samples)
    np.testing.assert_allclose(ridge_regression(regressor, tau, d=10.0, prior=dda.prior()), dda.prior(), atol=1e-9)


def test_bound_on_the_ridge(dda: RigidBody, samples: list[Array]) -> None:
    smallest = smallest_nonzero_eigenvalue(torque_regressor(dda, *samples), rank=15)
    # The thesis measured 3395 on the arm's own 600 samples.
    assert smallest == pytest.approx(3395.0, rel=0.2)
    assert smallest_nonzero_eigenvalue(torque_regressor(dda, *samples), rank=16) < 1e-9 * smallest
