"""The form of a bent viscous friction against the laws of papers, each beside a dry friction."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from estimator.effects.viscous_friction import SHAPES, bent

Array = NDArray[np.float64]

LAWS: dict[str, Callable[[Array], Array]] = {
    "power 0.3": lambda v: v**0.3,
    "power 0.7": lambda v: v**0.7,
    "hyperbola": lambda v: v / (1.0 + v),
    "arc of a tangent": lambda v: np.arctan(2.0 * v),
    "flat arc of a tangent": np.arctan,
    "hyperbolic tangent": np.tanh,
    "sigmoid": lambda v: 1.0 / (1.0 + np.exp(-5.0 * v)) - 0.5,
    "polynomial": lambda v: v - 0.03 * v**3,
}
"""Of speeds v above zero, in multiples of their rms."""
SPEEDS = np.abs(np.random.default_rng(0).normal(size=2000)) + 1e-6
LEAST, MOST = np.min(SHAPES, axis=0), np.max(SHAPES, axis=0)
"""Bends and sharpnesses between which shapes are refined."""


def left(viscous: Array, torque: Array) -> Array:
    """(samples,) of the torque's rms, what it leaves beside a dry friction; neither of them negative."""
    columns = np.stack([np.ones_like(SPEEDS), viscous], axis=1)
    return np.asarray(columns @ nnls(columns, torque)[0] - torque) / np.sqrt(np.mean(torque**2))


@pytest.mark.parametrize("law", LAWS)
def test_a_bent_friction_is_what_no_straight_one_is(law: str) -> None:
    torque = LAWS[law](SPEEDS)
    straight = float(np.sqrt(np.mean(left(SPEEDS, torque) ** 2)))
    best = min(
        least_squares(lambda shape: left(bent(SPEEDS, *shape), torque), start, bounds=(LEAST - 1e-9, MOST + 1e-9)).cost
        for start in SHAPES
    )
    own = float(np.sqrt(2.0 * best / len(SPEEDS)))
    assert own < 0.02
    assert straight > 0.06
    assert own < 0.25 * straight


def test_it_is_straight_at_rest_and_has_a_limit() -> None:
    for sharpness in (0.5, 1.0, 3.0):
        assert bent(np.array([1e-9]), 2.0, sharpness)[0] == pytest.approx(1e-9, rel=1e-3)
        assert bent(np.array([-1e12]), 2.0, sharpness)[0] == pytest.approx(-0.5, rel=1e-3)
