"""Friction of one form is told as that form, with its own numbers, and once."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Finding
from estimator.effects import catalogue

Array = NDArray[np.float64]
Play = Callable[..., list[Trajectory]]
FIRST = np.array([1.0, 0.0])
"""On the first of two joints."""


def near(finding: Finding, name: str, truth: float, errors: float = 3.5) -> bool:
    told = finding.parameters[name]
    return bool(abs(told.value - truth) < errors * told.standard_error)


@pytest.mark.parametrize("noise", [0.02, 0.1])
@pytest.mark.parametrize("exponent", [1.2, 1.6, 2.0])
@pytest.mark.parametrize("sharpness", [0.002, 0.02])
def test_a_rise_from_rest_has_its_own_speed_exponent_and_sign(
    make_chain: Callable[..., RigidBody], play_twice: Play, noise: float, exponent: float, sharpness: float
) -> None:
    """However sharp the sign is: one that went with the Stribeck velocity made that 0.05 rad/s, and the rise larger."""
    body = make_chain("rr")

    def rising(q: Array, dq: Array) -> Array:
        level = 1.0 + 0.8 * np.exp(-(np.abs(dq / 0.25) ** exponent))
        return FIRST * (level * np.tanh(dq / sharpness) + 0.3 * dq)

    found = diagnose(body, play_twice(body, rising, noise=noise))
    (finding,) = found.findings
    assert (finding.effect, finding.status, found.unexplained) == ("stribeck_friction", "named", {})
    truth = {"level": 1.0, "breakaway": 1.8, "velocity": 0.25, "exponent": exponent, "coefficient": 0.3}
    assert all(near(finding, name, value) for name, value in truth.items()), finding.parameters


@pytest.mark.parametrize("noise", [0.01, 0.1])
def test_an_exact_sign_is_dry_friction_s(make_chain: Callable[..., RigidBody], play_twice: Play, noise: float) -> None:
    """As of torques that are computed from a motion: it turns over between two samples."""
    body = make_chain("rr")
    found = diagnose(body, play_twice(body, lambda q, dq: FIRST * (np.sign(dq) + 0.3 * dq), noise=noise))
    assert found.verdict == "named"
    assert {finding.effect for finding in found.findings} == {"coulomb_friction", "viscous_friction"}


def test_friction_larger_one_way_takes_its_offset_with_it(
    make_chain: Callable[..., RigidBody], play_twice: Play
) -> None:
    body = make_chain("rr")

    def larger(q: Array, dq: Array) -> Array:
        return FIRST * np.where(dq > 0.0, 1.3 + 0.2 * dq, -0.8 + 0.35 * dq)

    (finding,) = diagnose(body, play_twice(body, larger, noise=0.05)).findings
    assert finding.effect == "asymmetric_friction"
    truth = {"level_positive": 1.3, "level_negative": 0.8, "coefficient_positive": 0.2, "coefficient_negative": 0.35}
    assert all(near(finding, name, value) for name, value in truth.items()), finding.parameters


def test_a_drag_that_grows_with_the_square_of_the_speed_rises_from_no_rest(
    make_chain: Callable[..., RigidBody], play_twice: Play
) -> None:
    """Though a rise with a viscous friction imitates it to a hundredth."""
    body = make_chain("rr")
    dragged = play_twice(body, lambda q, dq: FIRST * (np.sign(dq) + 0.5 * dq * np.abs(dq)), noise=0.1)
    found = diagnose(body, dragged)
    assert not any(f.effect == "stribeck_friction" and f.status == "named" for f in found.findings), found.findings
    assert "speed" in found.unexplained[0].signature


def test_what_a_soft_sign_leaves_speaks_for_no_rise(make_chain: Callable[..., RigidBody], play_twice: Play) -> None:
    """Softer than the grid goes: what is left is a form, a thousandth of the friction, beside a noise as small."""
    body = make_chain("rr")
    found = diagnose(body, play_twice(body, lambda q, dq: FIRST * (np.tanh(dq / 0.25) + 0.3 * dq), noise=0.02))
    dry = next(finding for finding in found.findings if finding.effect == "coulomb_friction")
    behind = {rival.effect: rival.log_likelihood_gap for rival in dry.rivals if rival.place == dry.place}
    assert dry.status == "named"
    assert behind["stribeck_friction"] > 100.0


@pytest.mark.parametrize(
    ("level", "rise", "viscous", "falls"),
    [
        (1.0, 0.8, 0.3, True),
        (1.0, 0.8, 0.0, True),
        (0.0, 0.5, 0.0, True),
        (1.0, 0.05, 0.0, False),
        (0.3, 0.7, 3.0, False),
        (0.0, 4.0, 14.0, False),
    ],
)
def test_a_stribeck_friction_falls_from_rest(level: float, rise: float, viscous: float, falls: bool) -> None:
    """By a tenth of its level or its rise at some speed, whatever the viscous one beside it."""
    law = catalogue()["stribeck_friction"]
    assert law.differs(np.array([0.25, 1.4, 0.001]), np.array([level, rise, viscous])) == falls


@pytest.mark.parametrize(("share", "named"), [(0.008, False), (0.04, True)])
def test_what_is_a_hundredth_of_dry_friction_has_no_name(
    make_chain: Callable[..., RigidBody], play_twice: Play, share: float, named: bool
) -> None:
    """Whatever it looks like, and however far it is above the noise: no friction has its law's form to that."""
    body = make_chain("rr")

    def rippled(q: Array, dq: Array) -> Array:
        return FIRST * (np.tanh(dq / 0.02) + share * np.sqrt(2.0) * np.sin(9.0 * q))

    found = diagnose(body, play_twice(body, rippled, noise=0.01))
    assert ("cogging" in {finding.effect for finding in found.findings}) == named
