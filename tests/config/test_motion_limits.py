"""Motions against limits: what is refused, in which words, and that the remedy is true."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config import InputError, Installation
from config.motion import SampledMotion, check_motion, fitting_duration, point_to_point
from config.motion.curves import RestToRest

angle1, angle2, angle3 = st.floats(0.2, 6.1), st.floats(0.0, 5.5), st.floats(-1.2, 4.6)
poses = st.tuples(angle1, angle2, angle3).map(np.array)


def move(q0: np.ndarray | list[float], q1: np.ndarray | list[float], seconds: float) -> SampledMotion:
    t = np.linspace(0, seconds, 1001)
    return SampledMotion(t, *RestToRest(np.array([q0, q1], dtype=float), [seconds], 5).evaluate(t))


def test_position_beyond_a_limit(dda: Installation) -> None:
    with pytest.raises(InputError) as caught:
        check_motion(move([3, 5, 1], [3, 6, 1], 2), dda, "wave")
    assert str(caught.value) == (
        "wave: joint2 reaches 6 rad at 2.000 s, 0.5 rad beyond 5.5; keep it between 0 and 5.5 rad"
    )


def test_velocity_and_acceleration_name_the_worst_and_the_cure(dda: Installation) -> None:
    with pytest.raises(InputError) as caught:
        check_motion(move([1, 5, 1], [5, 5, 4], 0.5), dda, "wave")
    assert str(caught.value) == (
        "wave: joint1: acceleration 92.38 rad/s² at 0.105 s is 71.9 rad/s² beyond its limit 20.5 (joint3 too); "
        "it fits when played in 1.062 s instead of 0.500 s"
    )


@given(poses, poses, st.floats(0.05, 1.0))
def test_the_duration_in_the_remedy_fits(dda: Installation, q0: np.ndarray, q1: np.ndarray, seconds: float) -> None:
    tried = move(q0, q1, seconds)
    slower = fitting_duration(tried, dda)
    check_motion(move(q0, q1, slower), dda)
    if slower > seconds:
        with pytest.raises(InputError, match="it fits when played in"):
            check_motion(move(q0, q1, slower - 0.002), dda)


@given(poses, poses, st.floats(0.05, 1.0))
def test_point_to_point_keeps_to_its_share_of_the_limits(
    dda: Installation, q0: np.ndarray, q1: np.ndarray, speed: float
) -> None:
    moved = point_to_point(q0, q1, dda, speed)
    np.testing.assert_allclose(moved.q[[0, -1]], [q0, q1], atol=1e-12)
    np.testing.assert_allclose(np.diff(moved.t), 1 / dda.cycle.rate_hz)
    velocity = np.array([j.limits.velocity_rad_s for j in dda.joint])
    acceleration = np.array([j.limits.acceleration_rad_s2 for j in dda.joint])
    assert np.all(np.abs(moved.dq) <= velocity * speed * (1 + 1e-9))
    assert np.all(np.abs(moved.ddq) <= acceleration * speed**2 * (1 + 1e-9))


def test_point_to_point_is_no_slower_than_it_must_be(dda: Installation) -> None:
    moved = point_to_point(np.array([1.0, 2, 1]), np.array([5.0, 2, 1]), dda, 1.0)
    assert np.abs(moved.ddq).max() / 20.5 == pytest.approx(1, abs=0.01)


@pytest.mark.parametrize(
    ("q1", "speed", "sentence"),
    [
        ([3, 6, 1], 0.5, "joint2 reaches 6 rad"),
        ([3, np.nan, 1], 0.5, "point to point: an end is not finite"),
        ([3, 2, 1], 0.0, "speed 0.0 is not above 0 and at most 1"),
        ([3, 2, 1], 1.5, "speed 1.5 is not above 0 and at most 1"),
    ],
)
def test_point_to_point_refuses(dda: Installation, q1: list[float], speed: float, sentence: str) -> None:
    with pytest.raises(InputError, match=sentence):
        point_to_point(np.array([3.0, 2, 1]), np.array(q1), dda, speed)


def test_point_to_point_wants_an_angle_a_joint(dda: Installation) -> None:
    with pytest.raises(InputError, match="ends of 2 angles for 3 joints; give one a joint"):
        point_to_point(np.zeros(2), np.ones(2), dda)


@pytest.mark.parametrize("quantity", ["q", "dq", "ddq"])
def test_values_that_are_not_finite(dda: Installation, quantity: str) -> None:
    sampled = move([3, 2, 1], [3.5, 2, 1], 2)
    spoilt = getattr(sampled, quantity).copy()
    spoilt[250, 2] = np.nan
    with pytest.raises(InputError, match=rf"motion: joint3: {quantity} is not finite at 0\.500 s"):
        check_motion(replace(sampled, **{quantity: spoilt}), dda)


def test_a_motion_must_begin_and_end_at_rest(dda: Installation) -> None:
    whole = move([3, 2, 1], [3.5, 2, 1], 2)
    for part, what in ((slice(300, None), "begins"), (slice(None, 700), "ends")):
        cut = SampledMotion(whole.t[part], whole.q[part], whole.dq[part], whole.ddq[part])
        with pytest.raises(InputError, match=rf"joint1 {what} at .* rad/s; begin and end at rest"):
            check_motion(cut, dda)


def test_a_motion_for_another_number_of_joints(dda: Installation) -> None:
    with pytest.raises(InputError, match="motion: has 2 joints; dda has 3"):
        check_motion(move([3, 2], [3, 2.1], 1), dda)
