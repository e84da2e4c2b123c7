"""Section 7.3: the same path in the least time within the limits."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest

from config import InputError
from learner.inverse_model import DecoupledModel
from learner.retiming import PathLimits, reserve, retime

WIDE = 1e3


def test_one_joint_accelerates_then_brakes() -> None:
    """Bang-bang: 2·√(d·I/τ)."""
    limits = PathLimits(np.array([3.0]), np.array([WIDE]), np.array([WIDE]))
    found = retime(DecoupledModel(np.array([0.5])), np.linspace(0.0, 1.2, 50)[:, None], limits, 1e-3)
    assert found.duration == pytest.approx(2.0 * np.sqrt(1.2 * 0.5 / 3.0), rel=0.01)
    assert np.abs(found.torque).max() == pytest.approx(3.0, rel=0.01)
    np.testing.assert_allclose(found.q[[0, -1], 0], [0.0, 1.2], atol=1e-3)


def test_a_speed_limit_is_kept() -> None:
    limits = PathLimits(np.array([3.0]), np.array([0.8]), np.array([WIDE]))
    found = retime(DecoupledModel(np.array([0.5])), np.linspace(0.0, 1.2, 50)[:, None], limits, 1e-3)
    assert np.abs(found.dq).max() == pytest.approx(0.8, rel=0.01)
    # From rest to 0.8 rad/s at 6 rad/s², and back: 0.8/6 s longer than the way at full speed.
    assert found.duration == pytest.approx(1.2 / 0.8 + 0.8 / 6.0, rel=0.01)


class Rubbing:
    """One joint with viscous and Coulomb friction."""

    def torque(self, q: Any, dq: Any, ddq: Any) -> Any:
        return 0.5 * ddq + 0.4 * dq + 0.3 * np.tanh(dq / 0.01)


def test_friction_counts() -> None:
    limits = PathLimits(np.array([3.0]), np.array([WIDE]), np.array([WIDE]))
    path = np.linspace(0.0, 1.2, 50)[:, None]
    found = retime(Rubbing(), path, limits, 1e-3)
    inside = slice(20, -20)
    assert np.abs(found.torque[inside]).max() < 3.0 * 1.03
    assert np.percentile(np.abs(found.torque[inside]), 20) > 2.7
    # Friction brakes for nothing: the arm brakes harder than it accelerates.
    assert np.argmax(found.dq) * 1e-3 > 0.52 * found.duration


def test_two_links_use_a_limit_throughout(planar_model: Any, motion: Any) -> None:
    reference = motion((0.0, 90.0), (90.0, 17.0), 1.0, 2e-3)
    limits = PathLimits(np.array([20.0, 6.0]), np.array([WIDE, WIDE]), np.array([WIDE, WIDE]))
    found = retime(planar_model, reference.q, limits, 2e-3)
    used = np.max(np.abs(found.torque) / limits.torque, axis=1)
    assert used.max() < 1.06
    assert np.median(used) > 0.97
    # The same path: where joint 1 is, joint 2 is as it was.
    np.testing.assert_allclose(np.interp(found.q[:, 0], reference.q[:, 0], reference.q[:, 1]), found.q[:, 1], atol=2e-3)
    slow = PathLimits(limits.torque / 4.0, limits.speed, limits.acceleration)
    assert retime(planar_model, reference.q, slow, 2e-3).duration == pytest.approx(2.0 * found.duration, rel=0.01)


def test_the_servo_keeps_a_reserve() -> None:
    left = reserve(np.array([10.0]), np.array([100.0]), np.array([5.0]), np.array([0.01]), np.array([0.1]))
    np.testing.assert_allclose(left, [8.5])


class Hanging:
    def torque(self, q: Any, dq: Any, ddq: Any) -> Any:
        return ddq + 10.0 * np.cos(q)


def test_a_path_on_which_the_arm_cannot_stand_is_refused() -> None:
    limits = PathLimits(np.array([9.0]), np.array([WIDE]), np.array([WIDE]))
    with pytest.raises(InputError, match=r"lacks .* N·m to stand"):
        retime(Hanging(), np.linspace(-1.0, 1.0, 50)[:, None], limits, 1e-3)
    with pytest.raises(InputError, match="does not move"):
        retime(Hanging(), np.ones((50, 1)), limits, 1e-3)
