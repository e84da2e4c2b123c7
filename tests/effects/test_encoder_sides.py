"""Elasticity and backlash against two masses whose equations are integrated here, the encoder on either of them."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.integrate import solve_ivp

from estimator.arm_model import ArmModel, FittedEffect
from estimator.convolution import convolve
from estimator.effects import Place, Scales, Signals, effect
from estimator.effects.transmission import ON_LINK, ON_MOTOR
from estimator.filtering import plan_filter, smooth_motion
from estimator.rigid_body import RigidBody, load_rigid_body
from estimator.trajectory import Trajectory
from estimator.twin.replay import replay
from estimator.twin.tracking import Tracking

Array = NDArray[np.float64]
INERTIA, SHARE, WEIGHT, RATE = 2.0, 0.3, 6.0, 1000.0
"""kg·m² of motor and link together, the motor's part, N·m of the link's weight lying level, Hz."""
URDF = f"""<robot name='pendulum'><link name='base'/><link name='arm'>
<inertial><origin xyz='0.5 0 0'/><mass value='{WEIGHT / 9.81 / 0.5}'/>
<inertia ixx='1.2' iyy='{INERTIA - WEIGHT / 9.81 * 0.5}' izz='1.2' ixy='0' ixz='0' iyz='0'/></inertial></link>
<joint name='hinge' type='revolute'><parent link='base'/><child link='arm'/><axis xyz='0 -1 0'/>
<limit lower='-9' upper='9' velocity='9' effort='99'/></joint></robot>"""
SIDES = pytest.mark.parametrize("side", [ON_MOTOR, ON_LINK], ids=["motor", "link"])


@dataclass(frozen=True)
class TwoMasses:
    """What both sides did, (samples,) each."""

    t: Array
    motor: tuple[Array, Array, Array]
    link: tuple[Array, Array, Array]
    """Angle, speed and acceleration."""
    torque: Array

    def signals(self, body: RigidBody, side: float) -> Signals:
        q, dq, ddq = (x[:, None] for x in (self.link if side == ON_LINK else self.motor))
        return Signals.of_motion(body, self.t, q, dq, ddq)


def swung(stiffness: float, damping: float, gap: float = 0.0, duration: float = 4.0) -> TwoMasses:
    """A servo on the motor swings the link through a spring with a gap."""
    motor_inertia, link_inertia = SHARE * INERTIA, (1.0 - SHARE) * INERTIA
    w = 2.0 * np.pi * np.array([0.5, 1.1, 2.3])

    def reference(t: Array | float) -> Array:
        return np.asarray(0.5 * np.sin(w[0] * t) + 0.2 * np.sin(w[1] * t + 1.0) + 0.05 * np.sin(w[2] * t + 2.0))

    def servo(t: Array | float, angle: Array, speed: Array) -> Array:
        before, now, after = (reference(t + h) for h in (-1e-3, 0.0, 1e-3))
        slope, bend = (after - before) / 2e-3, (after - 2.0 * now + before) / 1e-6
        forward = INERTIA * bend + WEIGHT * np.cos(now)
        return np.asarray(forward + 80.0 * (now - angle) + 25.0 * (slope - speed))

    def forces(t: Array | float, x: Array) -> tuple[Array, Array]:
        twist = x[0] - x[1]
        pressed = twist - np.clip(twist, -gap / 2.0, gap / 2.0)
        spring = stiffness * pressed + damping * (x[2] - x[3]) * (pressed != 0.0 if gap else 1.0)
        return servo(t, x[0], x[2]), spring

    def slope(t: float, x: Array) -> Array:
        torque, spring = forces(t, x)
        return np.array(
            [x[2], x[3], (torque - spring) / motor_inertia, (spring - WEIGHT * np.cos(x[1])) / link_inertia]
        )

    t = np.arange(0.0, duration, 1.0 / RATE)
    start = float(reference(0.0))
    x = solve_ivp(
        slope, (0.0, duration), [start, start - gap / 2.0, 0.0, 0.0], "LSODA", t, rtol=1e-8, atol=1e-10, max_step=1e-3
    ).y
    torque, spring = forces(t, x)
    motor = (x[0], x[2], (torque - spring) / motor_inertia)
    return TwoMasses(t, motor, (x[1], x[3], (spring - WEIGHT * np.cos(x[1])) / link_inertia), torque)


def error(found: Array, expected: Array, band: float) -> float:
    """Relative, below ``band`` Hz, when what swung at the beginning has died away."""
    smooth = plan_filter(RATE, band).smooth
    left, whole = (convolve(x[800:, None], smooth) for x in (found - expected, expected))
    return float(np.sqrt(np.mean(left**2) / np.mean(whole**2)))


@pytest.fixture(scope="module")
def body() -> RigidBody:
    return load_rigid_body(URDF)


@SIDES
def test_elasticity_is_that_of_two_masses(body: RigidBody, side: float) -> None:
    stiffness, damping = 4000.0, 30.0
    ran = swung(stiffness, damping)
    signals = ran.signals(body, side)
    parameters = {"stiffness": stiffness, "damping": damping}
    found = effect("joint_elasticity").torque(Place(0), parameters, signals, np.array([SHARE, side]))
    assert error(found[:, 0], ran.torque - signals.tau_rigid[:, 0], 10.0) < 0.05


@SIDES
def test_a_stiffer_joint_is_met_the_better(body: RigidBody, side: float) -> None:
    """The law is of first order: what it misses falls with the square of 1/k, its error with 1/k."""
    errors = []
    for stiffness in (1500.0, 6000.0):
        ran = swung(stiffness, 0.01 * stiffness)
        signals = ran.signals(body, side)
        parameters = {"stiffness": stiffness, "damping": 0.01 * stiffness}
        found = effect("joint_elasticity").torque(Place(0), parameters, signals, np.array([SHARE, side]))
        errors.append(error(found[:, 0], ran.torque - signals.tau_rigid[:, 0], 6.0))
    assert errors[1] < max(0.5 * errors[0], 1e-3)


def test_the_sides_are_told_apart(body: RigidBody) -> None:
    """The one law on the other's recording is worse than none."""
    parameters = {"stiffness": 4000.0, "damping": 30.0}
    ran = swung(4000.0, 30.0)
    for side, other in ((ON_MOTOR, ON_LINK), (ON_LINK, ON_MOTOR)):
        signals = ran.signals(body, side)
        found = effect("joint_elasticity").torque(Place(0), parameters, signals, np.array([SHARE, other]))
        assert error(found[:, 0], ran.torque - signals.tau_rigid[:, 0], 10.0) > 1.0


@SIDES
def test_backlash_is_that_of_two_masses(body: RigidBody, side: float) -> None:
    """As recordings are read: smoothed, so that a blow has no corners."""
    gap, plan = 0.01, plan_filter(RATE, 8.0)
    ran = swung(1e5, 400.0, gap)
    angle = ran.link[0] if side == ON_LINK else ran.motor[0]
    motion, inner = smooth_motion(plan, angle[:, None], None, None), slice(plan.edge, -plan.edge)
    signals = Signals.of_motion(body, ran.t[inner], motion.q, motion.dq, motion.ddq)
    signals = replace(signals, tau=convolve(ran.torque[:, None], plan.smooth))
    found = effect("backlash").torque(Place(0), {"gap": gap}, signals, np.array([SHARE, side]))
    assert error(found[:, 0], (signals.torque - signals.tau_rigid)[:, 0], 8.0) < 0.4


@SIDES
def test_the_twin_has_both_sides(body: RigidBody, side: float) -> None:
    """MuJoCo's two masses under a servo, against the columns along the motion that they made."""
    fitted = FittedEffect(
        "joint_elasticity", Place(0), {"stiffness": 8000.0, "damping": 80.0}, shape=np.array([SHARE, side])
    )
    model, t = ArmModel(body, (fitted,)), np.arange(0.0, 4.0, 2e-3)
    w = 2.0 * np.pi * np.array([0.5, 2.0])
    q = (np.sin(t[:, None] * w) * [0.5, 0.1]).sum(axis=1)[:, None]
    dq = (np.cos(t[:, None] * w) * w * [0.5, 0.1]).sum(axis=1)[:, None]
    ddq = np.gradient(dq, t, axis=0)
    forward = ArmModel(body).torque(q, dq, ddq, t)
    inertia = np.array([INERTIA])
    ran = replay(
        model, Trajectory(t, q, forward, dq), Tracking("servo", q, dq, forward, 400.0 * inertia, 30.0 * inertia)
    )
    plan = plan_filter(500.0, 8.0)
    motion, inner = smooth_motion(plan, ran.q, None, None), slice(plan.edge, -plan.edge)
    tau = convolve(ran.tau, plan.smooth)
    without, left = (
        np.std((tau - m.torque(motion.q, motion.dq, motion.ddq, t[inner]))[400:-50]) for m in (ArmModel(body), model)
    )
    assert left < 0.15 * without


@SIDES
@pytest.mark.parametrize("name", ["joint_elasticity", "backlash"])
def test_nothing_swings_on_a_fitted_body_s_negative_inertia(name: str, side: float) -> None:
    """Of a massless model the body that fits stands in, and a wrist's inertia may come out below zero."""
    t = np.arange(2000) / 100.0
    q, dq, ddq = (x[:, None] for x in (np.sin(t), np.cos(t), -np.sin(t)))
    negative = load_rigid_body(URDF)
    parameters = negative.prior()
    parameters[4:] *= -1.0
    signals = Signals.of_motion(negative.with_parameters(parameters), t, q, dq, ddq)
    law = effect(name)
    for theta in law.grid(Place(0), Scales.of([signals], 10.0)):
        if theta[-1] == side:
            assert np.abs(law.columns(Place(0), signals, theta)).max() < 1e3
