"""Joint spring: k·(q − q0) of a cable, a hose or a counterbalance, straight, yielding or hardening."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import Instant, PlantDraft

Array = NDArray[np.float64]

STRAIGHT, PULLING, PUSHING = 0.0, 1.0, -1.0
"""Forms: of any stiffness, and bent about a centre that it pulls to or pushes away from."""
BENDS = (-2.0, 2.0, 5.0)
"""To try, times half of the joint's range."""
CENTRES = (-0.1, 0.2, 0.5, 0.8, 1.1)
"""To try, as shares of the joint's range from its lower end."""
_NO_BEND = 1e-6
"""1/rad; less is none."""


class JointSpring(JointEffect):
    """k·(q − q0), or bent about q0: (k − κ)·tanh(β·(q − q0))/β + κ·(q − q0) yields with the way, as a cylinder between
    two points does about its dead centre; with sinh(|β|·(q − q0))/|β| for a β below zero it hardens, as a hose that is
    pulled tight.

    theta is the form, β and q0; of a straight one the last two say no more than from where its force is counted. The
    stiffness may be negative: a counterbalance pushes away from where it is in line with the arm. κ has the same sign:
    what pulls near its centre and pushes farther away turns back as a periodic torque does, and no spring.
    """

    name = "joint_spring"
    momentary = True
    units: ClassVar = {"stiffness": "N·m/rad", "centre": "rad", "bend": "1/rad", "straight": "N·m/rad"}
    choices = (0,)
    confused_with = ("base_tilt", "joint_elasticity", "torque_offset")
    contains = ("torque_offset",)
    typical: ClassVar = {"torque_offset": (1.0, 0.0)}
    looks_like = ("cogging", "contact", "base_tilt")
    seen_against = "q"
    experiment = "rest in a grid of poses over the range of {joint}"

    def grid(self, place: Place, scales: Scales) -> Array:
        joint = self.joint(place)
        low, reach = float(scales.q_low[joint]), float(scales.q_high[joint] - scales.q_low[joint])
        if reach <= 0.0:
            return np.array([[STRAIGHT, 0.0, low]])
        shapes = [[2.0 * bend / reach, low + share * reach] for bend in BENDS for share in CENTRES]
        straight = [STRAIGHT, 0.0, low + 0.5 * reach]
        return np.array([straight, *([way, *shape] for way in (PULLING, PUSHING) for shape in shapes)])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        q = signals.q[:, self.joint(place)]
        form, bend, centre = _form(theta), float(theta[1]), float(theta[2])
        if form == STRAIGHT:
            return np.stack([q - centre, np.ones_like(q)], axis=1)[:, None, :]
        return form * np.stack([bent(q - centre, bend), q - centre], axis=1)[:, None, :]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        free = np.full(2, np.inf)
        return (-free if _form(theta) == STRAIGHT else np.zeros(2)), free

    def usual(self, theta: Array) -> bool:
        """Of a straight one, that its centre is a radian from the middle of the joint's range."""
        return _form(theta) == STRAIGHT

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        first, second = map(float, coefficients)
        form, bend, centre = _form(theta), float(theta[1]), float(theta[2])
        if form == STRAIGHT:
            return {"stiffness": first, "centre": centre - second / first if first else 0.0}
        return {"stiffness": form * (first + second), "centre": centre, "bend": bend, "straight": form * second}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        stiffness, centre = float(parameters["stiffness"]), float(parameters["centre"])
        if "bend" not in parameters:
            return np.array([STRAIGHT, 0.0, 0.0]), np.array([stiffness, -stiffness * centre])
        straight = float(parameters["straight"])
        form = PULLING if stiffness >= 0.0 else PUSHING
        theta = np.array([form, float(parameters["bend"]), centre])
        return theta, form * np.array([stiffness - straight, straight])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        joint, stiffness, centre = self.joint(place), float(parameters["stiffness"]), float(parameters["centre"])
        if "bend" not in parameters:
            plant.add_spring(joint, stiffness, centre)
            return
        bend, straight = float(parameters["bend"]), float(parameters["straight"])
        plant.add_spring(joint, straight, centre)

        def yielding(at: Instant) -> float:
            return (stiffness - straight) * float(bent(np.array(at.q - centre), bend))

        plant.spending.append((joint, yielding))


def _form(theta: Array) -> float:
    """Errors of parameters are told by slopes, also to the side of a form."""
    return float(np.round(theta[0]))


def bent(way: Array, bend: float) -> Array:
    """rad; the ``way`` (rad) itself where it is small, and less with the way, or more where ``bend`` is negative."""
    if abs(bend) < _NO_BEND:
        return way
    return np.asarray((np.tanh if bend > 0.0 else np.sinh)(abs(bend) * way) / abs(bend))


EFFECT = JointSpring()
