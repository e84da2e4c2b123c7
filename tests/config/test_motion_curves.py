"""Curves: exact derivatives, rest at both ends, and what each kind promises."""

from __future__ import annotations

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from config.motion.curves import REST_TO_REST, Curve, Fourier, RestToRest, Spline

JOINTS = 3
angles = st.lists(st.floats(-3, 3), min_size=JOINTS, max_size=JOINTS)
durations = st.floats(0.2, 5.0)


@st.composite
def through_points(draw: st.DrawFn) -> tuple[np.ndarray, list[float]]:
    points = draw(st.lists(angles, min_size=2, max_size=6))
    return np.array(points), [draw(durations) for _ in points[1:]]


@st.composite
def curves(draw: st.DrawFn) -> Curve:
    kind = draw(st.sampled_from(["rest5", "rest7", "spline", "fourier"]))
    points, seconds = draw(through_points())
    if kind == "spline":
        return Spline(np.concatenate(([0.0], np.cumsum(seconds))), points)
    if kind == "fourier":
        return Fourier(points[0], points / 6, points[::-1] / 6, draw(st.floats(0.1, 1.0)), seconds[0], draw(durations))
    return RestToRest(points, seconds, int(kind[-1]), draw(st.sampled_from([0.0, 0.3])))


@given(curves(), st.floats(0.01, 0.99))
def test_derivatives_are_those_of_the_positions(curve: Curve, share: float) -> None:
    h = 1e-5 * curve.duration_s
    t = share * curve.duration_s + np.array([-h, 0.0, h])
    q, dq, ddq = curve.evaluate(t)
    scale = 1 + np.abs(ddq).max()
    np.testing.assert_allclose((q[2] - q[0]) / (2 * h), dq[1], atol=1e-3 * h * 1e5 * scale)
    np.testing.assert_allclose((dq[2] - dq[0]) / (2 * h), ddq[1], atol=0.02 * scale)


@given(curves())
def test_ends_at_rest_and_holds_there(curve: Curve) -> None:
    q, dq, ddq = curve.evaluate(np.array([0.0, curve.duration_s, curve.duration_s + 1.0]))
    scale = 1e-7 * (1 + np.abs(curve.evaluate(np.linspace(0, curve.duration_s, 200))[2]).max())
    np.testing.assert_allclose(dq, 0, atol=scale)
    np.testing.assert_allclose(ddq, 0, atol=scale)
    np.testing.assert_allclose(q[2], q[1], atol=1e-12)


@given(through_points(), st.sampled_from([5, 7]), st.floats(0, 1))
def test_moves_rest_at_every_way_point(
    given_points: tuple[np.ndarray, list[float]], order: int, dwell_s: float
) -> None:
    points, seconds = given_points
    curve = RestToRest(points, seconds, order, dwell_s)
    arrivals = np.cumsum(seconds) + dwell_s * np.arange(len(seconds))
    q, dq, _ = curve.evaluate(arrivals)
    np.testing.assert_allclose(q, points[1:], atol=1e-9)
    np.testing.assert_allclose(dq, 0, atol=1e-9)
    assert curve.duration_s == pytest.approx(sum(seconds) + dwell_s * (len(seconds) - 1))


@pytest.mark.parametrize(("order", "speed", "acceleration"), [(5, 15 / 8, 10 / 3**0.5), (7, 35 / 16, 84 / 5**1.5)])
def test_peaks_of_the_unit_moves(order: int, speed: float, acceleration: float) -> None:
    shape, x = REST_TO_REST[order], np.linspace(0, 1, 100_001)
    assert shape(0.0) == 0 and shape(1.0) == pytest.approx(1)
    assert np.abs(shape.deriv(1)(x)).max() == pytest.approx(speed, rel=1e-6)
    assert np.abs(shape.deriv(2)(x)).max() == pytest.approx(acceleration, rel=1e-6)


@given(through_points())
def test_spline_passes_every_point(given_points: tuple[np.ndarray, list[float]]) -> None:
    points, seconds = given_points
    times = np.concatenate(([0.0], np.cumsum(seconds)))
    np.testing.assert_allclose(Spline(times, points).evaluate(times)[0], points, atol=1e-8)


def test_spline_has_least_jerk() -> None:
    """Moving an extra knot between the points, in place or time, can only add jerk (Flash and Hogan's criterion)."""
    times, points = np.array([0.0, 1.0, 1.8, 3.0]), np.array([[0.0], [1.0], [0.4], [2.0]])
    best = Spline(times, points)

    def jerk(curve: Curve) -> float:
        t = np.linspace(0, 3, 60_001)
        return float(np.sum(np.gradient(curve.evaluate(t)[2][:, 0], t) ** 2) * (t[1] - t[0]))

    knot = 1.4
    there = best.evaluate(np.array([knot]))[0]
    for shift in (-0.02, 0.02):
        other = Spline(np.insert(times, 2, knot), np.insert(points, 2, there + shift, axis=0))
        assert jerk(other) > jerk(best) * 1.0001
    moves = RestToRest(points, list(np.diff(times)), 5)
    assert jerk(moves) > 2 * jerk(best)


def test_a_single_stretch_of_the_spline_is_the_fifth_order_move() -> None:
    points = np.array([[0.0, 1.0], [2.0, -1.0]])
    t = np.linspace(0, 1.5, 50)
    for ours, theirs in zip(
        Spline(np.array([0.0, 1.5]), points).evaluate(t), RestToRest(points, [1.5], 5).evaluate(t), strict=True
    ):
        np.testing.assert_allclose(ours, theirs, atol=1e-10)


def test_fourier_repeats_exactly_between_rise_and_fall() -> None:
    random = np.random.default_rng(3)
    curve = Fourier(np.zeros(2), random.normal(size=(4, 2)), random.normal(size=(4, 2)), 0.25, 8.0, 0.7)
    assert curve.duration_s == pytest.approx(9.4)
    t = 0.7 + np.linspace(0, 4, 101)
    for first, second in zip(curve.evaluate(t), curve.evaluate(t + 4.0), strict=True):
        np.testing.assert_allclose(first, second, atol=1e-9)
    np.testing.assert_allclose(curve.evaluate(np.array([0.0]))[0], 0, atol=1e-12)
