"""Corrections within the limits: better than a clip, and exactly the wanted torque where nothing is in the way."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from learner.constrained import FEEDBACK_SHARE, TorqueLimits, constrained
from learner.feedback_loop import FeedbackLoop
from learner.linearisation import LinearArm

Array = NDArray[np.float64]
H, INERTIA = 2e-3, 0.5
LOOP = FeedbackLoop(np.array([80.0]), np.array([9.0]), H)
ARM = LinearArm(np.full((3, 1, 1), INERTIA), np.zeros((3, 1, 1)), np.zeros((3, 1, 1)))


def motion() -> tuple[Array, Array, Array]:
    t = np.linspace(0.0, 1.0, 500)[:, None]
    q = 10 * t**3 - 15 * t**4 + 6 * t**5
    return q, 30 * t**2 - 60 * t**3 + 30 * t**4, INERTIA * (60 * t - 180 * t**2 + 120 * t**3)


def limits(torque: float, rate: float = 1e4, low: float = -1.0, high: float = 2.0) -> TorqueLimits:
    return TorqueLimits(np.array([torque]), np.array([rate]), np.array([[low, high]]), np.array([5.0]))


def errors(torque: Array, wanted: Array) -> Array:
    """Speed errors of the arm under its servo when it gets ``torque`` in place of what it needs."""
    e = v = 0.0
    found = []
    for short in (torque - wanted)[:, 0]:
        v += H / INERTIA * (short - LOOP.stiffness[0] * e - LOOP.damping[0] * v)
        e += H * v
        found.append(v)
    return np.array(found)


def test_what_keeps_the_limits_is_left_alone() -> None:
    q, dq, wanted = motion()
    assert constrained(wanted, q, dq, ARM, LOOP, limits(50.0)) is wanted


@pytest.mark.parametrize(("torque", "rate"), [(2.6, 1e4), (50.0, 20.0)], ids=["torque", "rate"])
def test_it_keeps_them_and_beats_the_clip(torque: float, rate: float) -> None:
    q, dq, wanted = motion()
    allowed = limits(torque, rate)
    found = constrained(wanted, q, dq, ARM, LOOP, allowed)
    most = (1 - FEEDBACK_SHARE) * torque
    assert np.abs(found).max() <= most + 1e-9
    assert np.abs(np.diff(found[:, 0])).max() <= rate * H * (1 + 1e-6)
    clipped = np.clip(wanted, -most, most)
    for k in range(1, len(clipped)):
        clipped[k] = np.clip(clipped[k], clipped[k - 1] - rate * H, clipped[k - 1] + rate * H)
    assert np.abs(errors(found, wanted)).sum() < 0.9 * np.abs(errors(clipped, wanted)).sum()


def test_a_motion_that_no_torque_can_keep_inside_is_refused() -> None:
    q, dq, wanted = motion()
    with pytest.raises(InputError, match=r"practice: joint number 1 .* N·m at .* s .*slow the motion down"):
        constrained(wanted, q, dq, ARM, LOOP, limits(1.0, high=1.0001), "practice")
    held = wanted + 4.0
    with pytest.raises(InputError, match="at its ends, at rest"):
        constrained(held, q, dq, ARM, LOOP, limits(4.0))
