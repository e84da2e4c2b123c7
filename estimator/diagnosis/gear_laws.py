"""What makes the angle of a motor, at the joint, differ from the angle behind its gear: laws of that deflection.

    q_motor − q = columns(theta) · coefficients + a constant of each recording, where the encoders' zeros are

They bear the names of the catalogue's effects that they show; their parameters are the same.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.maps import MEMORY, Map
from estimator.effects import Law, Parameters, Place, Scales, Signals
from estimator.effects.signals import averaged_sign
from estimator.effects.transport_delay import DELAYS
from estimator.effects.waves import amplitude_and_phase, quadratures
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_TURNING = 0.02
"""rms speeds within which a friction turns over, rms torques within which the side of a gap does."""


class GearLaw(Law):
    """A law of the deflection of ``joints``, those with encoders on both sides; each one's own by default."""

    equation = "deflection"

    def __init__(self, joints: Sequence[int]) -> None:
        self.joints = tuple(joints)

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(joint) for joint in self.joints]

    @staticmethod
    def joint(place: Place) -> int:
        assert place.joint is not None
        return place.joint


class Elasticity(GearLaw):
    """The gear winds up by the torque that it carries, δ = (τ − c·sign(dq))/k: the motor's torque, less a friction on
    its way to the spring. τ is `Signals.tau_rigid`."""

    name = "joint_elasticity"
    units: ClassVar = {"stiffness": "N·m/rad"}
    named_for = (0,)
    seen_against = "tau"
    experiment = "load {joint} in rest by known weights, both ways"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.joint(place)
        torque, speed = signals.tau_rigid[:, joint], signals.dq[:, joint]
        rubbing = -averaged_sign(speed, max(_TURNING * _rms(speed), 1e-9))
        return _without_constant(np.column_stack([torque, rubbing]))[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.zeros(2), np.full(2, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"stiffness": float(1.0 / coefficients[0]) if coefficients[0] > 0.0 else np.inf}


class Gap(GearLaw):
    """Half a gap ahead or behind, on the side on which the torque presses."""

    name = "backlash"
    units: ClassVar = {"gap": "rad"}
    seen_against = "tau"
    experiment = "reverse {joint} where gravity loads it, and where it does not"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        torque = signals.tau_rigid[:, self.joint(place)]
        side = averaged_sign(torque, max(_TURNING * _rms(torque), 1e-9))
        return _without_constant(0.5 * side[:, None])[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.zeros(1), np.full(1, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"gap": float(coefficients[0])}


class Eccentricity(GearLaw):
    """Once a turn of the joint: an encoder's disc, or the gear's last wheel, out of centre."""

    name = "encoder_eccentricity"
    units: ClassVar = {"amplitude": "rad", "phase": "rad"}
    seen_against = "q"
    experiment = "turn {joint} slowly through full turns, both ways"

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        return _without_constant(quadratures(signals.q[:, self.joint(place)]))[:, None, :]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(self.units, amplitude_and_phase(coefficients), strict=True))


class Lateness(GearLaw):
    """The angles behind the gears are late against the motors', all alike or one joint's; of a negative delay the
    motors' are. theta is the delay of the shape, as of the catalogue's `transport_delay`."""

    name = "transport_delay"
    units: ClassVar = {"delay": "s"}
    seen_against = "dq"
    experiment = "swing every joint at two frequencies, a fast and a slow one"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(), *(super().places(body) if len(self.joints) > 1 else [])]

    def timed(self, place: Place) -> int:
        return -1

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return self.joints if place.joint is None else (place.joint,)

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array(DELAYS)[:, None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        own = list(self.rows(signals.body, place))
        # The motor is where the late angle comes to, (q(t + δ) − q(t))/δ.
        ahead = signals.dq[:, own] + 0.5 * float(theta[0]) * signals.ddq[:, own]
        return _without_constant(ahead)[:, :, None]

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"delay": float(coefficients[0])}


class GearMap(Map):
    """What a deflection depends on that no law explains."""

    equation = "deflection"

    def __init__(self, joints: Sequence[int], quantity: str) -> None:
        super().__init__(quantity)
        self.joints = tuple(joints)

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(joint) for joint in self.joints]


def gear_laws(joints: Sequence[int]) -> list[Law]:
    """All that a deflection of these joints may have."""
    quantities = ("angle", "speed", "acceleration", "torque", "time", MEMORY)
    laws = [law(joints) for law in (Elasticity, Gap, Eccentricity, Lateness)]
    return [*laws, *(GearMap(joints, quantity) for quantity in quantities)]


def _without_constant(columns: Array) -> Array:
    """Where a recording's zeros are tells nothing."""
    return np.asarray(columns - columns.mean(axis=0))


def _rms(x: Array) -> float:
    return float(np.sqrt(np.mean(x**2)))
