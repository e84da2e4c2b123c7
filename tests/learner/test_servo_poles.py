"""Poles of the closed loop against what the loop does sample by sample."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.finite_interval import lifted
from learner.linearisation import LinearArm
from learner.servo_poles import swinging

PERIOD = 2e-3
SERVO = FeedbackLoop(np.array([1200.0, 400.0]), np.array([60.0, 20.0]), PERIOD, 2)


def arm(light: float, points: int) -> LinearArm:
    """Two coupled joints; the second's inertia is ``light`` times what its servo is made for."""
    inertia: NDArray[np.float64] = np.array([[1.9, 0.1 * light], [0.1 * light, 0.6 * light]])
    nothing = np.zeros((points, 2, 2))
    return LinearArm(np.tile(inertia, (points, 1, 1)), nothing, nothing)


def test_the_arm_that_the_servo_is_made_for_is_held() -> None:
    assert swinging(arm(1.0, 4), SERVO) is None


@pytest.mark.parametrize("delay", [1, 2, 4])
def test_a_light_joint_swings_as_fast_as_its_pole_says(delay: int) -> None:
    loop = replace(SERVO, delay=delay)
    samples = 400
    found = swinging(arm(0.01, samples), loop)
    assert found is not None
    assert found.joint == 1
    _, errors = lifted(arm(0.01, samples), loop)
    swings = np.abs(errors[:120, 1, 1])
    grown = np.log(swings[110:120].max() / swings[60:70].max()) / 50
    assert grown == pytest.approx(np.log(found.growth), rel=0.02)


def test_the_instant_and_its_frequency_are_told() -> None:
    stiff = FeedbackLoop(np.array([4000.0]), np.array([0.5]), PERIOD)
    inertia = np.array([1.0, 1.0, 0.1])[:, None, None]
    nothing = np.zeros_like(inertia)
    found = swinging(LinearArm(inertia, nothing, nothing), stiff)
    assert found is not None
    assert found.instant == 2
    assert found.frequency == pytest.approx(np.sqrt(4000.0 / 0.1) / (2 * np.pi), rel=0.1)
