"""The form of a bent spring against the stand-in's springs, which are other code: a gas cylinder, a hose."""

from __future__ import annotations

from collections.abc import Callable
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.optimize import least_squares, nnls

from estimator.effects.joint_spring import bent
from virtual_hw.hidden.springs import HydraulicCounterbalance, JointSpring

Array = NDArray[np.float64]

REACH = 1.4
"""rad either side: 0.4 of a turn."""


def cylinder(aligned: float) -> Callable[[Array], Array]:
    table = {
        "joint": "j",
        "anchor_m": 0.14,
        "rod_m": 0.1,
        "aligned_rad": aligned,
        "preload_n": 90.0,
        "gas_travel_m": 0.26,
    }
    law = HydraulicCounterbalance.model_validate(table).law()
    return np.vectorize(lambda q: law.torque(q, 0.0, 1e-3))


def hose() -> Callable[[Array], Array]:
    table = {"joint": "j", "stiffness_nm_rad": 0.5, "centre_rad": -0.2, "cubic_nm_rad3": 2.0}
    law = JointSpring.model_validate(table).law()
    return np.vectorize(lambda q: law.torque(q, 0.0, 1e-3))


def left(columns: Callable[[Array, Array], Array], starts: Array, torque: Array, q: Array, one_sign: bool) -> float:
    """Share of the torque's rms that a law leaves at the best shape that steps from any of the starts lead to."""

    def residual(theta: Array) -> Array:
        x = columns(theta, q)
        if one_sign:
            return torque - x @ nnls(x, torque)[0]
        return torque - x @ np.linalg.lstsq(x, torque, rcond=None)[0]

    best = min(float(np.mean(least_squares(residual, start).fun ** 2)) for start in starts)
    return float(np.sqrt(best / np.mean(torque**2)))


def spring(theta: Array, q: Array) -> Array:
    return np.stack([bent(q - theta[1], float(theta[0])), q - theta[1]], axis=1)


def line(theta: Array, q: Array) -> Array:
    return np.stack([np.sin(theta[0] * q), np.cos(theta[0] * q)], axis=1)


@pytest.mark.parametrize(
    "torque",
    [partial(cylinder, a) for a in (-0.5, -0.2, 0.0, 0.3, 0.5)] + [hose],
    ids=["-0.5", "-0.2", "0", "0.3", "0.5", "hose"],
)
def test_a_bent_spring_is_what_no_straight_one_and_no_line_is(torque: Callable[[], Callable[[Array], Array]]) -> None:
    q = REACH * np.sin(np.linspace(0.0, 40.0, 800))
    measured = torque()(q)
    x = np.stack([q, np.ones_like(q)], axis=1)
    straight = float(np.sqrt(np.mean((measured - x @ np.linalg.lstsq(x, measured, rcond=None)[0]) ** 2)))
    straight /= float(np.sqrt(np.mean(measured**2)))
    starts = np.array([[bend, centre] for bend in (-1.5, 1.5, 3.5) for centre in (-0.8, -0.3, 0.0, 0.3, 0.8)])
    own = left(spring, starts, measured, q, one_sign=True)
    sine = left(line, np.arange(0.5, 4.0, 0.5)[:, None], measured, q, one_sign=False)
    assert own < 0.05
    assert own < 0.25 * straight
    assert own < 0.5 * sine
