"""A joint that stands: its angle is one number, to the last digit, and laws of its motion say nothing."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, identify_links, inverse_dynamics
from estimator.diagnosis.answer import Diagnosis
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]
NOISE = 0.2
"""N·m, white."""


@pytest.fixture(scope="module")
def recorded(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., Motion]
) -> Callable[..., tuple[RigidBody, list[Trajectory]]]:
    """Three joints, of which ``standing`` do; the first rubs, and torques of the second are off by an offset."""

    def make(
        standing: tuple[int, ...], playings: int = 2, speeds: bool = False, jitter: float = 0.0, poses: bool = False
    ) -> tuple[RigidBody, list[Trajectory]]:
        body, random, recordings = make_chain("rrr"), np.random.default_rng(0), []
        for number in range(3):
            t, q, dq, ddq = make_periodic(3, 6.0, 200.0, number)
            for joint in standing:
                q[:, joint], dq[:, joint], ddq[:, joint] = 0.1 + 0.4 * number * poses, 0.0, 0.0
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
            tau[:, 0] += 1.5 * np.tanh(dq[:, 0] / 0.01)
            tau[:, 1] += 4.0
            for _ in range(playings):
                stamps = t + jitter * random.normal(size=len(t))
                noisy = tau + NOISE * random.normal(size=q.shape)
                recordings.append(Trajectory(stamps, q, noisy, dq if speeds else None))
        return body, recordings

    return make


@pytest.fixture(scope="module")
def found(recorded: Callable[..., tuple[RigidBody, list[Trajectory]]]) -> Callable[..., Diagnosis]:
    def make(*arguments: object, **options: object) -> Diagnosis:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            return diagnose(*recorded(*arguments, **options))

    return make


@pytest.mark.parametrize(
    "options",
    [
        {},
        {"playings": 1},
        {"speeds": True},
        {"speeds": True, "jitter": 1e-5},
        {"jitter": 1e-5},
        {"poses": True},
        {"poses": True, "playings": 1},
    ],
)
def test_what_the_others_have_is_named_while_a_joint_stands(found: Callable[..., Diagnosis], options: dict) -> None:  # type: ignore[type-arg]
    answer = found((2,), **options)
    assert {(f.effect, f.place.joint) for f in answer.findings} == {("coulomb_friction", 0), ("torque_offset", 1)}
    assert not answer.unexplained


def test_a_joint_that_stands_is_told_of_its_torque_and_of_no_motion(found: Callable[..., Diagnosis]) -> None:
    answer = found((1,))
    told = {(f.effect, f.place.joint) for f in answer.findings}
    assert ("coulomb_friction", 0) in told
    (other,) = told - {("coulomb_friction", 0)}
    assert other == ("torque_offset", 1)
    assert set(answer.smallest_detectable["viscous_friction"]) == {0, 2}


def test_of_an_arm_of_which_nothing_moves_an_offset_is_told_and_no_friction(found: Callable[..., Diagnosis]) -> None:
    """Nor is it told from a torque constant that is off: to the last digit the same."""
    answer = found((0, 1, 2))
    (one,) = answer.findings
    assert one.status == "ambiguous" and one.place.joint == 1
    told = {one.effect, *(other.effect for other in one.alternatives)}
    assert {"torque_offset", "torque_constant_error"} <= told
    assert not any("friction" in effect for effect in told)
    assert not answer.unexplained
    assert "viscous_friction" not in answer.smallest_detectable
    assert set(answer.smallest_detectable["torque_offset"]) == {0, 2}


def test_links_behind_a_joint_that_stands_are_told_as_untold(
    recorded: Callable[..., tuple[RigidBody, list[Trajectory]]],
) -> None:
    body, recordings = recorded((1,))
    links = identify_links(body, recordings)
    assert links.status == "too little motion"
    (said,) = [warning for warning in links.warnings if "does not excite" in warning]
    assert body.joints[1] in said.split(": move")[1]
