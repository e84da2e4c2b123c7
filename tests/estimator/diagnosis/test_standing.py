"""A joint that stands: its angle is one number, to the last digit, and laws of its motion say nothing."""

from __future__ import annotations

import warnings
from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, identify_links, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis

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
        standing: tuple[int, ...],
        playings: int = 2,
        speeds: bool = False,
        jitter: float = 0.0,
        poses: bool = False,
        tremble: float = 0.0,
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
                angles = q.copy()
                angles[:, standing] += tremble * random.normal(size=(len(t), len(standing)))
                recordings.append(Trajectory(stamps, angles, noisy, dq if speeds else None))
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


@pytest.mark.parametrize("tremble", [0.0, 1e-4])
def test_nothing_is_said_of_a_joint_that_never_moves(found: Callable[..., Diagnosis], tremble: float) -> None:
    """Its friction may hold it by what its torque is off by, however its servo trembles."""
    answer = found((1,), tremble=tremble)
    assert {(f.effect, f.place.joint) for f in answer.findings} == {("coulomb_friction", 0)}
    assert not answer.unexplained
    assert set(answer.smallest_detectable["viscous_friction"]) >= {0, 2}
    (note,) = [note for note in answer.notes if "never moved" in note]
    assert note.startswith("j2 never")


def test_an_arm_of_which_nothing_moves_is_refused(found: Callable[..., Diagnosis]) -> None:
    with pytest.raises(InputError, match="no joint moves, and friction may hold each of them"):
        found((0, 1, 2))


def test_links_behind_a_joint_that_stands_are_told_as_untold(
    recorded: Callable[..., tuple[RigidBody, list[Trajectory]]],
) -> None:
    body, recordings = recorded((1,))
    links = identify_links(body, recordings)
    assert links.status == "too little motion"
    (said,) = [warning for warning in links.warnings if "does not excite" in warning]
    assert body.joints[1] in said.split(": move")[1]
