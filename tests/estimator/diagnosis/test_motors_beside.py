"""An elastic joint seen from its link, with a motor that the URDF does not hold: the truth is two masses of which the
link's motion is given, and the motor's follows from it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.arm_model import FittedEffect
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.naming import judging
from estimator.diagnosis.telling.answer import Diagnosis, Finding
from estimator.effects import Place, Signals, effect
from estimator.effects.transmission import MOTOR_BESIDE, ON_LINK

Array = NDArray[np.float64]
Make = Callable[..., tuple[Array, Array, Array, Array]]
STIFFNESS, ROTOR, RELAXATION = 500.0, 0.4, 2e-3
"""N·m/rad, kg·m², s"""


def two_masses(body: RigidBody, make_periodic: Make, joint: int, rotor: float, rub: bool) -> list[Trajectory]:
    """Three motions of the link, each twice, with the torque of a motor of its own inertia behind a spring."""
    random, recordings = np.random.default_rng(4), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(body.n, 4.0, 500.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        w = 2j * np.pi * np.fft.rfftfreq(len(t), t[1])
        wound = np.fft.rfft(tau[:, joint]) / (STIFFNESS * (1.0 + RELAXATION * w))
        speed = dq[:, joint] + np.fft.irfft(wound * w, len(t))
        tau[:, joint] += rotor * (ddq[:, joint] + np.fft.irfft(wound * w**2, len(t)))
        tau[:, joint] += rub * (0.4 * np.tanh(speed / 0.01) + 0.6 * speed)
        for _ in range(2):
            noise = 0.005 * np.std(tau, axis=0) * random.normal(size=tau.shape)
            recordings.append(Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau + noise))
    return recordings


def found(diagnosis: Diagnosis, name: str) -> Finding:
    (finding,) = [one for one in diagnosis.findings if one.effect == name]
    return finding


@pytest.mark.parametrize("rub", [False, True], ids=["smooth", "rubbing"])
def test_a_motor_that_was_found_tells_the_stiffness(
    make_chain: Callable[..., RigidBody], make_periodic: Make, monkeypatch: pytest.MonkeyPatch, rub: bool
) -> None:
    """Taken for a tenth of the link or more, it would make the spring less than a tenth as stiff."""
    body = make_chain("rr")
    recordings = two_masses(body, make_periodic, 1, ROTOR, rub)
    diagnosis = diagnose(body, recordings)
    assert found(diagnosis, "rotor_inertia").parameters["inertia"].value == pytest.approx(ROTOR, rel=0.02)
    spring = found(diagnosis, "joint_elasticity")
    stiffness = spring.parameters["stiffness"]
    assert spring.status == "named"
    assert stiffness.value == pytest.approx(STIFFNESS, rel=0.04)
    assert abs(stiffness.value - STIFFNESS) < 3.5 * stiffness.standard_error
    assert spring.shape is not None
    assert spring.shape[1] == MOTOR_BESIDE
    monkeypatch.setattr(judging, "with_motors_beside", lambda evidence, scores, chosen, refined: (chosen, refined))
    of_a_share = found(diagnose(body, recordings), "joint_elasticity").parameters["stiffness"]
    assert of_a_share.value < 0.1 * STIFFNESS


def test_a_motor_beside_the_model_and_one_within_spend_the_same(
    make_chain: Callable[..., RigidBody], make_periodic: Make
) -> None:
    """The share of a link that has no other inertia than its motor's is that motor."""
    body = make_chain("rr")
    signals = Signals.of_motion(body, *make_periodic(2, 4.0, 500.0, 0))
    inertia = float(np.mean(signals.sensitivity[2][:, 1, 1]))
    parameters = {"stiffness": STIFFNESS, "damping": 0.0}
    within, beside = (
        FittedEffect("joint_elasticity", Place(1), parameters, shape=np.array(shape)).torque(signals)
        for shape in ([1e-3, ON_LINK], [1e-3 * inertia, MOTOR_BESIDE])
    )
    np.testing.assert_allclose(beside, within, atol=2e-3 * np.abs(within).max())


@pytest.mark.parametrize("name", ["joint_elasticity", "backlash"])
def test_what_is_seen_from_the_motor_has_its_inertia_in_the_model(name: str) -> None:
    law = effect(name)
    *others, _ = theta = np.zeros(4 if name == "joint_elasticity" else 3)
    assert law.with_motor(np.array(theta), 1.0) is None
    beside = law.with_motor(np.array([*others, ON_LINK]), 0.7)
    assert beside is not None
    assert list(beside[list(law.hidden)]) == [0.7, MOTOR_BESIDE]
