"""What an effect adds to the torque is what MuJoCo's bodies need when the effect is in the plant.

Two ways to the same law: the columns, from analytic derivatives of the inverse dynamics, and the simulation, which
steps bodies, sensors and transmissions. The arm is simulated under a servo; the torque it took is then compared with
what the model predicts for the motion it made.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.arm_model import ArmModel, FittedEffect
from estimator.convolution import convolve
from estimator.effects import Place, catalogue
from estimator.filtering import plan_filter, smooth_motion
from estimator.rigid_body import PARAMETERS, RigidBody
from estimator.trajectory import Trajectory
from estimator.twin.replay import replay
from estimator.twin.tracking import Tracking, mean_inertia

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array, Array]
RATE, BAND, SERVO_HZ = 200.0, 12.0, 10.0
SETTLED = 0.4
"""Share of the motion after which what swings has forgotten that the simulation began in its middle."""
JOINT = Place(1)
COUPLED = {"joint_other": 2, "ratio": -1.0, "coefficient": 2.0, "level": 2.0, "inertia": 0.5}
CHANGE = dict(zip(PARAMETERS, (0.0, 0.4, 0.0, 0.0, 0.1, 0.0, 0.0, 0.1, 0.0, 0.1), strict=True))


@dataclass(frozen=True)
class Case:
    """``left``: share of the effect's torque that may be unexplained; laws of first order leave their second."""

    name: str
    place: Place
    parameters: dict[str, float | Array]
    left: float = 0.04


ASYMMETRIC = {"level_positive": 5.0, "level_negative": 2.0, "coefficient_positive": 1.0, "coefficient_negative": 3.0}
CASES = [
    Case("viscous_friction", JOINT, {"coefficient": 5.0}),
    Case("viscous_friction", JOINT, {"coefficient": 9.0, "bend": 1.5, "sharpness": 0.7}),
    Case("coulomb_friction", JOINT, {"level": 5.0}),
    Case("asymmetric_friction", JOINT, ASYMMETRIC),
    Case(
        "stribeck_friction",
        JOINT,
        {"level": 3.0, "breakaway": 6.0, "velocity": 0.2, "coefficient": 1.0, "exponent": 1.3},
    ),
    Case("load_dependent_friction", JOINT, {"coefficient": 0.1}),
    Case("presliding", JOINT, {"stiffness": 500.0, "level": 5.0}),
    Case("friction_drift", JOINT, {"initial": 8.0, "final": 3.0, "time_constant": 0.5}),
    Case("friction_drift", JOINT, {"initial_coefficient": 8.0, "final_coefficient": 3.0, "time_constant": 0.5}),
    Case("rotor_inertia", JOINT, {"inertia": 1.0}),
    Case("joint_spring", JOINT, {"stiffness": 8.0, "centre": 0.3}),
    Case("joint_spring", JOINT, {"stiffness": -8.0, "centre": 0.3}),
    Case("joint_spring", JOINT, {"stiffness": 8.0, "centre": 0.3, "bend": 1.5, "straight": 2.0}),
    Case("joint_spring", JOINT, {"stiffness": -8.0, "centre": 0.3, "bend": -1.5, "straight": 2.0}),
    Case("joint_elasticity", JOINT, {"stiffness": 4000.0, "damping": 40.0}, 0.08),
    Case("backlash", JOINT, {"gap": 0.01}, 0.45),
    Case("cogging", JOINT, {"order": 7.0, "amplitude": 3.0, "phase": 0.4}),
    Case("torque_ripple", JOINT, {"order": 7.0, "amplitude": 0.1, "phase": 0.4}, 0.12),
    Case("torque_constant_error", JOINT, {"gain": 0.9}),
    Case("torque_nonlinearity", JOINT, {"dead_zone": 2.0}, 0.1),
    Case("torque_nonlinearity", JOINT, {"limit": 200.0}, 0.1),
    Case("torque_offset", JOINT, {"offset": 3.0}),
    Case("transmission_coupling", Place(1, other=2), COUPLED),
    Case("link_inertia", JOINT, CHANGE),
    Case("payload", Place(), {"mass": 1.0, "centre": np.array([0.0, 0.0, 0.1])}, 0.08),
    Case("base_tilt", Place(), {"roll": 0.05, "pitch": -0.08}, 0.06),
    Case("contact", Place(), {"where": np.array([1.0, 1.9]), "force": np.array([5.0, -8.0, 4.0])}, 0.08),
    Case("contact", Place(), {"where": np.array([0.3, 0.0, 0.0]), "force": np.array([-200.0, 0.0, 0.0])}, 0.08),
    Case("transport_delay", Place(channel="torque"), {"delay": 0.01}),
    Case("transport_delay", Place(1, channel="torque"), {"delay": 0.01}),
    Case("transport_delay", Place(channel="position"), {"delay": 0.01}),
    Case("encoder_offset", JOINT, {"offset": 0.05}, 0.08),
    Case("encoder_eccentricity", JOINT, {"amplitude": 0.04, "phase": 0.3}, 0.1),
]


def simulated(model: ArmModel, motion: Motion) -> Trajectory:
    """What the model's arm does under a servo."""
    body = model.body
    t, q, dq, ddq = motion
    inertia, w = mean_inertia(body, q), 2.0 * np.pi * SERVO_HZ
    feedforward = ArmModel(body).torque(q, dq, ddq, t)
    servo = Tracking("servo", q, dq, feedforward, inertia * w**2, 2.0 * inertia * w)
    found = replay(model, Trajectory(t, q, np.zeros_like(q), dq), servo)
    return Trajectory(t, found.q, found.tau, found.dq)


def unexplained(model: ArmModel, recorded: Trajectory) -> Array:
    """Torque less the model's, in the band that both are smoothed to."""
    plan = plan_filter(RATE, BAND)
    motion = smooth_motion(plan, recorded.q, None, None)
    inner = slice(plan.edge, -plan.edge)
    predicted = model.torque(motion.q, motion.dq, motion.ddq, recorded.t[inner])
    left = convolve(recorded.tau[inner] - predicted, plan_filter(RATE, BAND / 6.0).smooth)
    return left[int(SETTLED * len(left)) :]


def test_every_effect_of_the_motion_has_a_case() -> None:
    at_rest = {"velocity_sensor_gain", *(name for name, e in catalogue().items() if e.equation == "wrench")}
    assert {case.name for case in CASES} == set(catalogue()) - at_rest


@pytest.mark.parametrize("case", CASES, ids=lambda case: case.name)
def test_columns_and_plant_agree(case: Case, arm: RigidBody, motion: Motion) -> None:
    model = ArmModel(arm, (FittedEffect(case.name, case.place, case.parameters),))
    recorded = simulated(model, motion)
    without, left = (np.sqrt(np.mean(unexplained(m, recorded) ** 2)) for m in (ArmModel(arm), model))
    assert without > 0.2, "the effect is too small to judge"
    assert left < case.left * without


def test_a_rigid_arm_is_simulated_as_the_inverse_dynamics_say(arm: RigidBody, motion: Motion) -> None:
    recorded = simulated(ArmModel(arm), motion)
    left = unexplained(ArmModel(arm), recorded)
    np.testing.assert_array_less(np.sqrt(np.mean(left**2, axis=0)), 3e-3 * np.sqrt(np.mean(recorded.tau**2, axis=0)))
    assert recorded.dq is not None
    slope = np.gradient(recorded.q, recorded.t, axis=0)
    np.testing.assert_allclose(recorded.dq[10:-10], slope[10:-10], atol=5e-3)


def test_a_velocity_sensor_reads_its_gain(arm: RigidBody, motion: Motion) -> None:
    model = ArmModel(arm, (FittedEffect("velocity_sensor_gain", JOINT, {"gain": 1.1}),))
    recorded = simulated(model, motion)
    assert recorded.dq is not None
    slope = np.gradient(recorded.q, recorded.t, axis=0)[10:-10]
    gain = np.sum(recorded.dq[10:-10] * slope, axis=0) / np.sum(slope**2, axis=0)
    np.testing.assert_allclose(gain, [1.0, 1.1, 1.0, 1.0, 1.0, 1.0], rtol=2e-3)
