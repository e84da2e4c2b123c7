"""Link inertia: one link's inertial parameters differ from the given model's by more than its tolerance."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import PARAMETERS, UNITS, RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]

WHOLE, DENSER = 0.0, 1.0
"""What the link may have beside the model's, an entry of theta: any ten parameters, or the same body once more, for a
share of its mass."""


class LinkInertia(Effect):
    """The parameters are what the link has beside the model's. Of any ten those are zero that a motion cannot tell
    from others of the same link, whatever it is: their columns are zero.

    Ten unknowns take much to be believed, and a link of another density has one. theta is which of these it is, then
    centre (m) and inertia (m²) of the given link, of a unit of its mass. Where nothing of the link but its inertia
    about an axis tells, that is told, and no density.
    """

    name = "link_inertia"
    of_link = True
    choices = tuple(range(10))
    units: ClassVar = dict(zip(PARAMETERS, UNITS, strict=True))
    confused_with = ("payload", "rotor_inertia", "torque_constant_error")
    experiment = "move {joint} and the joints around it alone, each at two accelerations and through gravity"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(joint) for joint in range(body.n)]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        assert place.joint is not None
        return body.ancestors(place.joint)

    def grid(self, place: Place, scales: Scales) -> Array:
        assert place.joint is not None
        link = scales.links[place.joint]
        if link[0] <= 0.0:
            return np.zeros((1, 10))
        return np.vstack([np.zeros(10), np.insert(link[1:] / link[0], 0, DENSER)])

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        assert place.joint is not None
        span = slice(10 * place.joint, 10 * place.joint + 10)
        columns = signals.regressor[:, self.rows(signals.body, place), span]
        told = signals.distinguishable[place.joint]
        if _is_whole(theta):
            columns[:, :, ~told] = 0.0
        elif not told[:4].any():
            columns[:] = 0.0
        return np.asarray(columns @ _of_form(theta))

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        free = np.full(_of_form(theta).shape[1], np.inf)
        return -free, free

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(PARAMETERS, map(float, _of_form(theta) @ coefficients), strict=True))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(10), np.array([parameters[name] for name in PARAMETERS], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        assert place.joint is not None
        plant.parameters[10 * place.joint : 10 * place.joint + 10] += self.unknowns(place, parameters)[1]


def _is_whole(theta: Array) -> bool:
    """What lies between the forms, as when an error is propagated, is the nearer one."""
    return bool(theta[0] < 0.5 * (WHOLE + DENSER))


def _of_form(theta: Array) -> Array:
    """(10, c) the ten parameters per unit of each coefficient."""
    return np.eye(10) if _is_whole(theta) else np.insert(theta[1:], 0, 1.0)[:, None]


EFFECT = LinkInertia()
