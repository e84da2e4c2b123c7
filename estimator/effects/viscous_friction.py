"""Viscous friction: b·dq, or less than that the faster a joint moves."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import JointEffect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

STRAIGHT, BENT = 0.0, 1.0
"""Forms: as fast as the joint moves, and falling behind that."""
PLAIN = 1.0
"""The sharpness of a bend, where none is given."""
REST = 0.0
"""The speed at which the coefficient of a model is told."""
SHAPES = ((0.15, PLAIN), (1.2, PLAIN), (0.4, 0.6), (2.0, 0.4), (0.4, 1.7), (3.0, 1.7), (0.7, 3.0))
"""To try: a bend, per joint's rms speed, and its sharpness."""


class ViscousFriction(JointEffect):
    """b·dq, or bent: b·dq/(1 + (β·|dq|)^γ)^(1/γ). Grease is thinner the faster it is sheared: a gear's friction falls
    behind what its slope at rest promises from a speed of about 1/β on, and is never more than b/β. (Waiboer, Aarts and
    Jonker, ECCOMAS Multibody Dynamics 2005, have a power of the speed.)

    theta is the form, β, γ, and of a bent one the speed at which its coefficient is told in a search, where all of its
    shapes have the same: recordings hardly tell a slope at rest. Beside a dry friction it is within two hundredths of
    powers of the speed, arcs of a tangent and polynomials.
    """

    name = "viscous_friction"
    momentary = True
    in_drive = True
    choices = (0, 3)
    units: ClassVar = {"coefficient": "N·m·s/rad", "bend": "s/rad", "sharpness": "–"}
    above_zero = ("bend", "sharpness")
    confused_with = ("coulomb_friction", "stribeck_friction")
    seen_against = "dq"
    experiment = "move {joint} at six or more constant speeds, both ways"

    def grid(self, place: Place, scales: Scales) -> Array:
        return np.array([[STRAIGHT, 0.0, PLAIN, REST]])

    def finer(self, place: Place, scales: Scales) -> Array:
        speed = float(scales.dq[self.joint(place)])
        return np.array([[BENT, bend / speed, sharpness, speed] for bend, sharpness in SHAPES])

    def plain(self, theta: Array) -> bool:
        return not _is_bent(theta)

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        dq = signals.dq[:, [self.joint(place)]]
        if _is_bent(theta):
            dq = _slope_at_rest(theta) * bent(dq, *map(float, theta[1:3]))
        return dq[:, :, None]

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        return self.nonnegative(1)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        if not _is_bent(theta):
            return {"coefficient": float(coefficients[0])}
        coefficient = float(coefficients[0]) * _slope_at_rest(theta)
        return {"coefficient": coefficient, "bend": float(theta[1]), "sharpness": float(theta[2])}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        bend, sharpness = parameters.get("bend", 0.0), parameters.get("sharpness", PLAIN)
        theta = np.array([BENT if "bend" in parameters else STRAIGHT, bend, sharpness, REST], dtype=float)
        return theta, np.array([parameters["coefficient"]], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        joint, (theta, coefficients) = self.joint(place), self.unknowns(place, parameters)
        (form, bend, sharpness, _), coefficient = map(float, theta), float(coefficients[0])
        if form == STRAIGHT:
            plant.viscous[joint] += coefficient
        else:
            plant.rubbing.append((joint, lambda at: coefficient * abs(float(bent(np.array(at.dq), bend, sharpness)))))


def bent(dq: Array, bend: float, sharpness: float) -> Array:
    """rad/s; the speed ``dq`` (rad/s) itself where it is small, and never more than one over the ``bend`` (s/rad)."""
    return np.asarray(dq / (1.0 + (bend * np.abs(dq)) ** sharpness) ** (1.0 / sharpness))


def _slope_at_rest(theta: Array) -> float:
    """In multiples of the friction by the speed, where the coefficient is told."""
    bend, sharpness, speed = map(float, theta[1:])
    return float((1.0 + (bend * speed) ** sharpness) ** (1.0 / sharpness))


def _is_bent(theta: Array) -> bool:
    """What lies between the forms, as when an error is propagated, is the nearer one."""
    return bool(theta[0] > 0.5 * (STRAIGHT + BENT))


EFFECT = ViscousFriction()
