"""Where the last link is and how it moves, against what holds a unit mass there."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest

from estimator.kinematics import tip_jacobian, tip_positions
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody


@pytest.mark.parametrize("kinds", ["r", "rrrrrr", "prr", "rpr"])
@pytest.mark.parametrize("aligned", [True, False])
def test_the_jacobian_is_the_torque_that_holds_a_unit_force(
    make_chain: Callable[..., RigidBody], kinds: str, aligned: bool
) -> None:
    body = make_chain(kinds, aligned)
    q = np.random.default_rng(3).normal(0.0, 1.5, (20, body.n))
    still, mass = np.zeros_like(q), np.zeros(10 * body.n)
    mass[-10] = 1.0
    held = [inverse_dynamics(replace(body, gravity=-axis), mass, q, still, still) for axis in np.eye(3)]
    np.testing.assert_allclose(tip_jacobian(body, q), np.stack(held, axis=2), atol=1e-12)


def test_the_jacobian_is_the_slope_of_the_position(make_chain: Callable[..., RigidBody]) -> None:
    body = make_chain("rrprr", False)
    q, step = np.random.default_rng(4).normal(0.0, 1.5, (20, body.n)), 1e-6
    for joint in range(body.n):
        way = step * np.eye(body.n)[joint]
        slope = (tip_positions(body, q + way) - tip_positions(body, q - way)) / (2.0 * step)
        np.testing.assert_allclose(tip_jacobian(body, q)[:, joint], slope, atol=1e-7)
