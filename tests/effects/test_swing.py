"""The swing of a mass that changes along a motion, beside an integrator of ordinary differential equations."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from estimator.effects.second_order import second_order_lag, swing

Array = NDArray[np.float64]
PERIOD = 0.012


def force(t: Array) -> Array:
    return np.asarray(np.sin(2.0 * t + 0.3) + 0.5 * np.sin(9.0 * t + 1.0) + 0.2 * np.sin(21.0 * t))


def inertia(t: Array) -> Array:
    return np.asarray(6.0 + 2.0 * np.sin(1.3 * t))


def damping(t: Array) -> Array:
    return np.asarray(8.0 + 2.6 * np.cos(1.3 * t))


@pytest.mark.parametrize("stiffness", [800.0, 2500.0, 30_000.0, 1e6])
def test_it_follows_a_mass_that_changes(stiffness: float) -> None:
    """From a resonance at 1.8 Hz, in the midst of the force, to one far beyond what samples show."""
    t = np.arange(0.0, 12.0, PERIOD)

    def moved(time: float, x: Array) -> list[float]:
        (at,) = np.array([time])
        return [x[1], float((force(at) - damping(at) * x[1] - stiffness * x[0]) / inertia(at))]

    truth = solve_ivp(moved, (0.0, t[-1]), [float(force(t[0])) / stiffness, 0.0], "Radau", t, rtol=1e-6, atol=1e-10).y[
        0
    ]
    found = swing(force(t), PERIOD, inertia(t), damping(t), np.full(len(t), stiffness))
    settled = t > 9.0
    np.testing.assert_allclose(found[settled], truth[settled], atol=0.02 * np.abs(truth[settled]).max())


@pytest.mark.parametrize("resonance", [1.0, 5.0, 20.0, 100.0])
def test_of_a_mass_that_stays_it_is_the_lag(resonance: float) -> None:
    t, w = np.arange(0.0, 12.0, PERIOD), 2.0 * np.pi * resonance
    even = np.ones(len(t))
    found = swing(force(t), PERIOD, even, 0.4 * w * even, w**2 * even)
    lag = second_order_lag(force(t), PERIOD, 0.4 / w, 1.0 / w**2) / w**2
    np.testing.assert_allclose(found, lag, atol=0.02 * np.abs(lag).max())


@pytest.mark.parametrize("lightest", [0.5, 0.05, 0.005])
def test_it_does_not_grow_where_the_mass_is_light(lightest: float) -> None:
    """For a moment of the motion the swing is faster than samples show."""
    t = np.arange(0.0, 20.0, PERIOD)
    mass = lightest + np.sin(0.7 * t) ** 2
    found = swing(force(t), PERIOD, mass, np.full(len(t), 1.0), np.full(len(t), 4000.0))
    assert np.abs(found).max() < 20.0 / 4000.0


def test_a_force_that_stays_is_held() -> None:
    even = np.ones(50)
    np.testing.assert_allclose(swing(3.0 * even, PERIOD, even, 0.5 * even, 100.0 * even), 0.03)
