"""What a friction leaves that is a matter of its form: no cause is lost beside it, and it has no name of its own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]
PlayTwice = Callable[..., list[Trajectory]]
Chain = Callable[..., RigidBody]


def bristle(q: Array, distance: float) -> Array:
    """Dahl's friction of one level along angles (samples,), step by step."""
    result = np.zeros_like(q)
    for k in range(1, len(q)):
        way = q[k] - q[k - 1]
        result[k] = np.sign(way) + (result[k - 1] - np.sign(way)) * np.exp(-abs(way) / distance)
    return result


@pytest.mark.parametrize("level", [5.0, 8.0])
def test_the_form_of_a_friction_of_many_times_the_noise_is_no_unknown(
    make_chain: Chain, play_twice: PlayTwice, level: float
) -> None:
    """A seventh of it gives way over 5 mrad, as no law of the catalogue does: less than any is exact to."""
    body = make_chain("rr")

    def friction(q: Array, dq: Array) -> Array:
        dry = 0.85 * np.sign(dq[:, 1]) + 0.15 * bristle(q[:, 1], 5e-3)
        return np.column_stack([np.zeros(len(q)), level * dry])

    found = diagnose(body, play_twice(body, friction))
    assert {f.effect for f in found.findings} <= {"coulomb_friction", "presliding"}
    assert found.unexplained == {}


def test_more_than_any_form_leaves_is_told(make_chain: Chain, play_twice: PlayTwice) -> None:
    """A torque that waves with the speed, a quarter of the friction: no law has that form."""
    body = make_chain("rr")

    def torque(q: Array, dq: Array) -> Array:
        return np.column_stack([np.zeros(len(q)), 4.0 * np.sign(dq[:, 1]) + np.sin(4.0 * dq[:, 1])])

    assert set(diagnose(body, play_twice(body, torque)).unexplained) == {1}


def test_bristles_may_rise_from_rest_unless_that_would_show(make_chain: Chain, play_twice: PlayTwice) -> None:
    body = make_chain("rr")
    told = {}
    for level in (0.1, 0.4):

        def friction(q: Array, dq: Array, level: float = level) -> Array:
            return np.column_stack([np.zeros(len(q)), level * bristle(q[:, 1], 2e-3)])

        (finding,) = diagnose(body, play_twice(body, friction)).findings
        assert finding.effect == "presliding"
        told[level] = finding.status, {a.effect for a in finding.alternatives if a.log_likelihood_gap < 3.0}
    assert told == {0.1: ("ambiguous", {"stribeck_friction"}), 0.4: ("named", set())}


def test_a_trifle_that_is_dry_makes_a_viscous_friction_none_that_rises_from_rest(
    make_chain: Chain, play_twice: PlayTwice
) -> None:
    body = make_chain("rr")

    def friction(q: Array, dq: Array) -> Array:
        speed = dq[:, 1]
        dry = 0.015 * np.sign(speed) * (1.0 + np.exp(-np.abs(speed) / 0.1))
        return np.column_stack([np.zeros(len(q)), 2.0 * speed + dry])

    (finding,) = diagnose(body, play_twice(body, friction, seconds=10.0)).findings
    assert (finding.effect, finding.status) == ("viscous_friction", "named")
