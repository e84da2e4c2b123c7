"""Bodies about other points than their centres, against Pinocchio's inertias and against finite differences."""

from __future__ import annotations

import numpy as np
import pinocchio as pin
import pytest

from estimator.parallel_axis import about_centre, unit_mass_at, unit_mass_slopes

ORDER = [0, 1, 3, 2, 4, 5]
"""Of xx xy xz yy yz zz among Pinocchio's xx xy yy xz yz zz."""


@pytest.mark.parametrize("seed", range(5))
def test_a_body_about_its_frame_and_about_its_centre(seed: int) -> None:
    body = pin.Inertia.Random()
    random = np.random.default_rng(seed)
    body.mass, body.lever = random.uniform(0.1, 9.0), random.normal(size=3)
    told = np.asarray(body.toDynamicParameters())
    parameters = np.concatenate([told[:4], told[4:][ORDER]])
    own = np.asarray(body.inertia)[np.triu_indices(3)]
    np.testing.assert_allclose(about_centre(parameters), own, atol=1e-12)
    np.testing.assert_allclose(parameters[4:], own + body.mass * unit_mass_at(np.asarray(body.lever)), atol=1e-12)


def test_how_a_mass_turns_harder_as_it_moves() -> None:
    centre, step = np.array([0.3, -0.2, 0.7]), 1e-6
    slopes = unit_mass_slopes(centre)
    for axis, way in enumerate(step * np.eye(3)):
        change = (unit_mass_at(centre + way) - unit_mass_at(centre - way)) / (2.0 * step)
        np.testing.assert_allclose(slopes[:, axis], change, atol=1e-9)
