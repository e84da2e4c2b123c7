"""A wall that the tool presses into, told from the laws of a joint that it looks like; and these from a wall."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from estimator.diagnosis.telling.answer import Diagnosis
from estimator.effects import catalogue

Array = NDArray[np.float64]
PlayTwice = Callable[..., list[Trajectory]]
Chain = Callable[..., RigidBody]


def wall(body: RigidBody, normal: tuple[float, float, float], at: float, stiffness: float) -> Callable[..., Array]:
    """What a wall ``at`` m along its normal takes of the torques where the last link's origin is behind it."""
    into, data = np.array(normal) / np.linalg.norm(normal), body.model.createData()
    last = body.model.njoints - 1

    def torque(q: Array, dq: Array) -> Array:
        result = np.zeros_like(q)
        for k, pose in enumerate(q):
            jacobian = pin.computeJointJacobian(body.model, data, pose, last)
            pin.forwardKinematics(body.model, data, pose)
            depth = max(float(into @ data.oMi[last].translation) - at, 0.0)
            result[k] = stiffness * depth * (data.oMi[last].rotation @ jacobian[:3]).T @ into
        return result

    return torque


def names(found: Diagnosis) -> list[tuple[str, int | None]]:
    return [(f.effect, f.place.joint) for f in found.findings]


@pytest.mark.parametrize(
    ("normal", "at", "stiffness"),
    [
        ((1.0, 0.3, 0.0), 0.22, 20.0),
        ((0.2, 1.0, 0.0), 0.05, 6.0),
        ((0.2, 1.0, 0.0), 0.05, 20.0),
        ((-1.0, 0.5, 0.0), -0.02, 20.0),
        ((-1.0, 0.5, 0.0), 0.05, 20.0),
    ],
)
def test_a_wall_is_no_law_of_the_joint_that_shows_it(
    make_chain: Chain,
    play_twice: PlayTwice,
    normal: tuple[float, float, float],
    at: float,
    stiffness: float,
) -> None:
    """Behind the upright first joint the tool goes round on a circle: any wall is a function of that angle there."""
    body = make_chain("rr")
    found = diagnose(body, play_twice(body, wall(body, normal, at, stiffness)))
    assert names(found) == [("contact", None)]
    assert found.unexplained == {}
    (contact,) = found.findings
    assert contact.status == "named"
    push, error = contact.parameters["force"].value, contact.parameters["force"].standard_error
    true = -stiffness * np.array(normal) / np.linalg.norm(normal)
    assert np.all(np.abs(push - true) <= 4.0 * np.asarray(error))
    assert error[2] == 0.0  # type: ignore[index]


@pytest.mark.parametrize(
    ("kinds", "normal", "at", "stiffness"),
    [
        ("rr", (-0.912, 0.409, 0.0), 0.070, 60.0),
        ("rr", (0.443, 0.897, 0.0), 0.212, 100.0),
        ("rrr", (0.394, 0.902, 0.175), 0.587, 60.0),
        ("rrr", (-0.671, -0.726, 0.149), 0.323, 100.0),
    ],
)
def test_a_wall_that_is_met_now_and_then_stands_between_those_that_are_tried(
    make_chain: Chain,
    play_twice: PlayTwice,
    kinds: str,
    normal: tuple[float, float, float],
    at: float,
    stiffness: float,
) -> None:
    """The nearest of the grid explains a sixth of what several lines of a joint do, or leads to no best wall."""
    body = make_chain(kinds)
    found = diagnose(body, play_twice(body, wall(body, normal, at, stiffness)))
    assert names(found) == [("contact", None)]
    assert found.unexplained == {}
    (contact,) = found.findings
    assert contact.status == "named"
    into = np.array(normal) / np.linalg.norm(normal)
    for name, true in (("where", at * into), ("force", -stiffness * into)):
        told = contact.parameters[name]
        assert np.all(np.abs(told.value - true) <= 4.0 * np.asarray(told.standard_error))


@pytest.mark.parametrize(("amplitude", "bend", "centre"), [(0.2, 2.0, -0.5), (0.4, 2.0, 0.3), (0.2, 3.0, 0.3)])
def test_a_wall_that_the_tool_is_never_before_is_none(
    make_chain: Chain, play_twice: PlayTwice, amplitude: float, bend: float, centre: float
) -> None:
    """Pressed into all of the time, it would push as any slow torque of the angle does: here a spring's between two
    points, of which the motion shows the better half of a turn."""
    body = make_chain("rr")

    def spring(q: Array, dq: Array) -> Array:
        away = q - centre
        return np.array([amplitude, 0.0]) * np.sin(away) / np.sqrt(1.3 + np.cos(away) * bend / 3.0)

    (finding,) = diagnose(body, play_twice(body, spring)).findings
    assert finding.effect in {"cogging", "joint_spring"}
    assert finding.place.joint == 0
    walls = [a.log_likelihood_gap for a in finding.alternatives if a.effect == "contact"]
    assert all(gap >= AMBIGUOUS for gap in walls)


def test_where_a_wall_is_and_which_way_it_pushes_are_four_numbers() -> None:
    contact = catalogue()["contact"]
    place = np.array([1.0, 0.0, 0.6, 0.8, 0.3])
    told = contact.parameters(contact.places(None)[0], place, np.array([100.0]))  # type: ignore[arg-type]
    assert sum(np.size(value) for value in told.values()) - contact.redundant(place) == 4
    assert contact.redundant(np.array([0.0, 1.0, 2.0, 0.0, 0.0])) == 0
