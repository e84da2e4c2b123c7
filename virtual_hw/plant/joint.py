"""One joint's drive train at run time: motor, friction, brake, transmission and the torques that act on the link."""

from __future__ import annotations

from collections.abc import Sequence

from virtual_hw.hidden.friction import BristleFriction
from virtual_hw.hidden.motor import MotorState
from virtual_hw.hidden.periodic import Harmonics
from virtual_hw.hidden.springs import JointLaw
from virtual_hw.hidden.transmission import TwoMassSpring


class DriveTrain:
    """Turns torque demands into the torque on the link, in the steps of `Plant`.

    Rigid: the link's degree of freedom is the motor's. Elastic: the motor is a mass of its own (``angle``, ``speed``)
    and the link feels the spring. ``force − implicit·dq⁺`` is the torque on the link, dq⁺ the speed at the step's end.
    """

    __slots__ = (
        "_acceleration",
        "_brake",
        "_braked",
        "_cogging",
        "_drive_torque",
        "_friction",
        "_laws",
        "_rotor",
        "_spring",
        "_transmitted",
        "angle",
        "force",
        "implicit",
        "motor",
        "speed",
    )

    def __init__(
        self,
        motor: MotorState,
        friction: BristleFriction | None,
        brake: BristleFriction,
        cogging: Harmonics,
        laws: Sequence[JointLaw],
        spring: TwoMassSpring | None,
        rotor_inertia: float,
        angle: float,
    ) -> None:
        self.motor = motor
        self._friction, self._brake, self._laws = friction, brake, tuple(laws)
        self._cogging = cogging if cogging else None
        self._spring, self._rotor = spring, rotor_inertia
        self._braked = True
        self._drive_torque = 0.0
        self._transmitted = 0.0
        self._acceleration = 0.0
        self.angle = angle
        """Of the motor, rad, at the joint."""
        self.speed = 0.0
        self.force = 0.0
        self.implicit = 0.0

    @property
    def elastic(self) -> bool:
        return self._spring is not None

    def rest(self, q: float, torque_needed: float) -> None:
        """Stand still at link angle ``q`` with the brake on, where the link needs ``torque_needed`` (N·m) to stay."""
        needed = torque_needed
        for law in self._laws:
            needed += law.torque(q, 0.0, 0.0)
        self._transmitted = needed
        self.angle = q if self._spring is None else q + self._spring.twist_for(needed)
        self._brake.hold(-needed - (0.0 if self._cogging is None else self._cogging.at(self.angle)))

    def command(self, demand_nm: float, braked: bool) -> None:
        """What holds for the coming tick. A brake that closes begins with relaxed bristles."""
        if braked and not self._braked:
            self._brake.z = 0.0
        self._braked = braked
        self._drive_torque = self.motor.torque(demand_nm, self.angle)

    def load(self, q: float, dq: float, q_mid: float, dq_mid: float, t: float, h: float) -> None:
        """Set ``force`` and ``implicit`` of the link for the step; link state at its begin and predicted middle."""
        spring = self._spring
        on_link = 0.0
        for law in self._laws:
            on_link -= law.torque(q_mid, dq_mid, h)
        if spring is None:
            self.angle, self.speed = q, dq
            self.implicit = self._rub(q_mid, dq, 2.0 * dq_mid - dq, t, h)
            self.force = self.force + on_link
            return
        half = 0.5 * h
        angle = self.angle + half * self.speed
        through = spring.torque(angle - q_mid, self.speed + half * self._acceleration - dq_mid)
        implicit = self._rub(angle, self.speed, self.speed + h * self._acceleration, t, h)
        self._acceleration = (self.force - through - implicit * self.speed) / (self._rotor + h * implicit)
        self._transmitted = through
        self.force, self.implicit = on_link + through, 0.0

    def _rub(self, angle: float, speed: float, forecast: float, t: float, h: float) -> float:
        """Motor-side torque into ``force``; returns its implicit coefficient."""
        force, implicit = self._drive_torque, 0.0
        if self._cogging is not None:
            force -= self._cogging.at(angle)
        if self._friction is not None:
            self._friction.linearise(angle, speed, forecast, self._transmitted, self.motor.kelvin, t, h)
            force -= self._friction.explicit
            implicit += self._friction.implicit
        if self._braked:
            self._brake.linearise(angle, speed, forecast, 0.0, 0.0, t, h)
            force -= self._brake.explicit
            implicit += self._brake.implicit
        self.force = force
        return implicit

    def settle(self, q: float, dq: float, h: float) -> None:
        """The step ended with the link at ``q``, ``dq``."""
        if self._spring is None:
            self.angle, self.speed = q, dq
        else:
            begin = self.speed
            self.speed = begin + h * self._acceleration
            self.angle += 0.5 * h * (begin + self.speed)
        spent = 0.0
        if self._friction is not None:
            spent = self._friction.settle(self.speed, h)
        if self._braked:
            spent += self._brake.settle(self.speed, h)
        if self._spring is None:
            self._transmitted = self._drive_torque - spent
        self.motor.warm(spent * self.speed, h)
