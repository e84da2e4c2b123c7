"""Transport delay: one channel of the recording is late, or filtered, or one joint's torque or angle late."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import replace
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.effects.effect import Effect, Equation, Parameters, Place
from estimator.effects.lateness import Lag, Lateness
from estimator.effects.second_order import second_order_lag
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

EQUATIONS: Mapping[str, Equation] = {
    "torque": "torque",
    "position": "torque",
    "velocity": "velocity",
    "wrench": "wrench",
}
"""Channel → the equation in which its lateness shows."""
DELAYS = (0.001, 0.003, 0.009, 0.025)
"""s, to try …"""
OF_AN_ANGLE = (0.003, 0.015)
"""… and of one joint's angle."""
LATE, FIRST_ORDER, SECOND_ORDER, SPEED_IN_TIME = 0.0, 1.0, 2.0, 3.0
"""What makes a channel late, an entry of theta: time alone, or of all torques a low-pass filter of the drives or the
recorder, of first order, or of second and maximally flat. One joint's angle is late by itself, or its speed with it."""

_FILTERS = (FIRST_ORDER, SECOND_ORDER)
_WORDS: Mapping[float, str] = {
    LATE: "",
    FIRST_ORDER: "as of a low-pass filter of first order",
    SECOND_ORDER: "as of a low-pass filter of second order",
    SPEED_IN_TIME: "beside a speed that is in time",
}


class TransportDelay(Effect):
    """All joints of a channel are late alike, or one joint's torque or angle by itself. theta is the delay δ of the
    shape (x(t − δ) − x(t))/δ, and what makes it late: of a filter, whose delay is that of slow signals, its answer
    stands for x(t − δ). The coefficient is the delay itself: to first order in it the two are independent, and they are
    made equal (`Law.timed`). Late angles make the torques seem early; one joint's alone make those of all seem wrong.
    """

    name = "transport_delay"
    units: ClassVar = {"delay": "s"}
    hidden = (1,)
    choices = (1,)
    confused_with = ("viscous_friction", "joint_elasticity", "presliding")
    experiment = "swing every joint at two frequencies, a fast and a slow one"

    def places(self, body: RigidBody) -> list[Place]:
        joints = range(body.n) if body.n > 1 else ()
        own = [Place(joint, channel=channel) for channel in ("torque", "position") for joint in joints]
        return [*(Place(channel=channel) for channel in EQUATIONS), *own]

    def equation_at(self, place: Place) -> Equation:
        assert place.channel is not None
        return EQUATIONS[place.channel]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        if place.joint is not None and not _of_an_angle(place):
            return (place.joint,)
        return tuple(range(6 if place.channel == "wrench" else body.n))

    def speed_rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        return (place.joint,) if place.joint is not None and _of_an_angle(place) else ()

    def timed(self, place: Place) -> int | None:
        if _of_an_angle(place):
            return 0
        return -1 if place.channel == "position" else 1

    def choices_at(self, place: Place) -> Mapping[int, tuple[float, ...]]:
        if _of_an_angle(place):
            return {1: (LATE, SPEED_IN_TIME)}
        return {1: (LATE, *(_FILTERS if place == Place(channel="torque") else ()))}

    def grid(self, place: Place, scales: Scales) -> Array:
        delays = OF_AN_ANGLE if _of_an_angle(place) else DELAYS
        return np.array([[delay, cause] for cause in self.choices_at(place)[1] for delay in delays])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        delay, cause = map(float, theta)
        by = -delay if place.channel == "position" else delay
        # What is late is told of the motion as it was recorded; all other laws are late with it.
        if place.joint is not None and _of_an_angle(place):
            # As it is tried first, a delay is not exact anyway.
            gained = signals.as_recorded.by_late_angle(place.joint, delay, small=delay in OF_AN_ANGLE)
            return gained[:, :, None] / delay
        signals = signals.in_time
        channel = {"velocity": signals.dq, "wrench": signals.load_wrench}.get(str(place.channel), signals.tau_rigid)
        assert channel is not None
        if place.joint is not None:
            channel = channel[:, [place.joint]]
        if cause == LATE:
            # Straight lines between samples would bend a signal that is late by a part of one.
            late = CubicSpline(signals.t, channel)(signals.t - by)
        else:
            late = second_order_lag(channel, signals.period, *_filter(theta))
        return np.asarray((late - channel) / abs(by))[:, :, None]

    def speed_columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        assert place.joint is not None
        delay, cause = map(float, theta)
        speed = signals.dq[:, place.joint]
        gained = CubicSpline(signals.t, speed)(signals.t + delay) - speed
        return np.asarray((cause == SPEED_IN_TIME) * gained[:, None, None] / delay)

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return np.zeros(1), np.full(1, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {"delay": float(coefficients[0])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        delay = float(parameters["delay"])
        return np.array([delay if delay > 0.0 else DELAYS[0], LATE]), np.array([delay])

    def lateness(self, body: RigidBody, place: Place, theta: Array) -> Lateness:
        if theta[1] in _FILTERS:
            return replace(Lateness.none(body.n), lag=_filter(theta))
        if _of_an_angle(place):
            # What goes with this joint's motion answers early.
            late = float(theta[0]) * (np.arange(body.n) == place.joint)
            return Lateness(-late, late)
        return super().lateness(body, place, theta)

    def form(self, shape: Array | None) -> str:
        return _WORDS[LATE if shape is None else float(shape[0])]

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        assert place.channel is not None
        joints = slice(None) if place.joint is None else place.joint
        plant.late.setdefault(place.channel, np.zeros(plant.body.n))[joints] += float(parameters["delay"])


def _of_an_angle(place: Place) -> bool:
    """Whether one joint's angle alone is late."""
    return place.joint is not None and place.channel == "position"


def _filter(theta: Array) -> Lag:
    """Of a filter with this delay at low frequencies: its time constant, of Butterworth's second order √2 over its
    corner."""
    delay, cause = map(float, theta)
    return delay, 0.5 * delay**2 if cause == SECOND_ORDER else 0.0


EFFECT = TransportDelay()
