"""Speeds that were computed from the angles beside them are no measurement, and nothing is concluded from them."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.differences import differenced, with_speeds_of_their_own

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]


@pytest.fixture
def recorded(make_periodic: Callable[..., Motion]) -> Trajectory:
    """Of two joints at 100 Hz, with noise of the angles, jitter and a lost sample; the second joint stands."""
    random = np.random.default_rng(0)
    t, q, dq, _ = make_periodic(2, 6.0, 100.0, 1)
    q = q + 1e-5 * random.normal(size=q.shape)
    q[:, 1], dq[:, 1] = 0.3, 0.0
    q[200, 0] = np.nan
    return Trajectory(t + 1e-5 * random.normal(size=len(t)), q, np.zeros_like(q), dq)


def backward(q: Array, t: Array) -> Array:
    return np.vstack([np.zeros((1, 2)), np.diff(q, axis=0) / np.diff(t)[:, None]])


def forward(q: Array, t: Array) -> Array:
    return np.roll(backward(q, t), -1, axis=0)


def central(q: Array, t: Array) -> Array:
    result = np.zeros_like(q)
    result[1:-1] = (q[2:] - q[:-2]) / (t[2:] - t[:-2])[:, None]
    return result


def gradient(q: Array, t: Array) -> Array:
    return np.asarray(np.gradient(q, t, axis=0))


@pytest.mark.parametrize("made", [backward, forward, central, gradient])
def test_differences_of_the_angles_are_found_as_they_were_written_down(
    recorded: Trajectory, made: Callable[[Array, Array], Array]
) -> None:
    written = np.round(made(recorded.q, recorded.t), 5)
    assert differenced(replace(recorded, dq=written))
    # A sensor of its own, late by three samples.
    assert not differenced(replace(recorded, dq=np.roll(written, 3, axis=0)))


def test_a_sensor_of_its_own_is_none(recorded: Trajectory) -> None:
    assert recorded.dq is not None
    assert not differenced(recorded)
    assert not differenced(replace(recorded, dq=1.001 * gradient(recorded.q, recorded.t)))
    assert not differenced(replace(recorded, dq=None))


def test_speeds_go_where_all_recordings_have_differences(recorded: Trajectory) -> None:
    same = replace(recorded, dq=gradient(recorded.q, recorded.t))
    assert [t.dq for t in with_speeds_of_their_own([same, same])] == [None, None]
    assert [t.dq is None for t in with_speeds_of_their_own([same, recorded])] == [False, False]


def test_speeds_that_are_differences_are_no_late_sensor(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., Motion]
) -> None:
    """At 100 Hz a central difference is smaller than the speed by more than the torques' noise hides."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for number in range(3):
        t, q, dq, ddq = make_periodic(2, 6.0, 100.0, number)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 0] += np.tanh(dq[:, 0] / 0.01)
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            noisy = tau + 0.02 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, noisy, np.gradient(measured, t, axis=0)))
    found = diagnose(body, recordings)
    assert {(f.effect, f.place.joint) for f in found.findings} == {("coulomb_friction", 0)}
    assert any("differences of the angles" in note for note in found.notes)
    sensed = [replace(r, dq=None if r.dq is None else 1.02 * r.dq) for r in recordings]
    told = diagnose(body, sensed)
    assert {f.effect for f in told.findings} >= {"velocity_sensor_gain"}
    assert not any("differences" in note for note in told.notes)
