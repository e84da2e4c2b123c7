"""Payload: a rigid body at the tool that the given model lacks."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.parallel_axis import unit_mass_at, unit_mass_slopes
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

OUT = (0.1, 0.2)
"""m from the last link's origin along its axes, either way, where a centre is tried first."""
COMPACT, BULKY = 0.0, 1.0
"""Whether its own inertia about its centre is left to the links' tolerance, or told: an entry of theta."""


class Payload(Effect):
    """A rigid body in the last link's frame.

    The coefficients of a bulky one are its ten parameters about the frame's origin, and then it is what the last link
    has beside the model's. Of a compact one only mass m and first moment h are free, and it turns about the origin with
    the inertia of h = m·c, which is not linear in them: J(m, h) = (|h|²·1 − h·hᵀ)/m. By Euler's theorem
    J = m·∂J/∂m + h·∂J/∂h; theta is the kind, and the centre c₀ for which these slopes are taken, so that J is exact
    where h/m is c₀.
    """

    name = "payload"
    units: ClassVar = {"mass": "kg", "centre": "m", "inertia": "kg·m²"}
    choices = (0,)
    confused_with = ("encoder_offset", "link_inertia")
    experiment = "play the same motion before and after the load is taken up"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place()]

    def grid(self, place: Place, scales: Scales) -> Array:
        axes = np.vstack([np.eye(3), -np.eye(3)])
        centres = np.vstack([np.zeros(3), *(out * axes for out in OUT)])
        return np.vstack([np.insert(centres, 0, COMPACT, axis=1), [BULKY, 0.0, 0.0, 0.0]])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        columns = np.array(signals.regressor[:, :, -10:])
        if not _bulky(theta):
            return np.asarray(columns[:, :, :4] + columns[:, :, 4:] @ _turning(theta[1:]))
        columns[:, :, ~signals.distinguishable[-1]] = 0.0
        return columns

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        """Neither its mass nor an inertia about an axis is negative."""
        lower = np.full(10, -np.inf)
        lower[[0, 4, 7, 9]] = 0.0
        count = 10 if _bulky(theta) else 4
        return lower[:count], np.full(count, np.inf)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        """``inertia`` (6: xx xy xz yy yz zz) about the centre, of a bulky one alone."""
        mass = float(coefficients[0])
        centre = coefficients[1:4] / mass if mass > 0.0 else np.zeros(3)
        told: dict[str, float | Array] = {"mass": mass, "centre": centre}
        if _bulky(theta):
            told["inertia"] = coefficients[4:] - mass * unit_mass_at(centre)
        return told

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        mass, centre = float(parameters["mass"]), np.array(parameters["centre"], dtype=float)
        body = mass * np.append(1.0, centre)
        if "inertia" not in parameters:
            return np.append(COMPACT, centre), body
        return np.array([BULKY, 0.0, 0.0, 0.0]), np.append(body, parameters["inertia"] + mass * unit_mass_at(centre))

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        theta, coefficients = self.unknowns(place, parameters)
        if not _bulky(theta):
            coefficients = np.append(coefficients, coefficients[0] * unit_mass_at(theta[1:]))
        plant.parameters[-10:] += coefficients


def _bulky(theta: Array) -> bool:
    """What lies between the kinds, as when an error is propagated, is the nearer one."""
    return bool(theta[0] > 0.5 * (COMPACT + BULKY))


def _turning(centre: Array) -> Array:
    """(6, 4) inertia about the origin per unit of mass and first moment of a mass near a centre."""
    return np.column_stack([-unit_mass_at(centre), unit_mass_slopes(centre)])


EFFECT = Payload()
