"""Link inertia: one link's inertial parameters differ from the given model's by more than its tolerance."""

from __future__ import annotations

from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Signals
from estimator.rigid_body import PARAMETERS, UNITS, RigidBody
from estimator.twin.plant import PlantDraft

Array = NDArray[np.float64]


class LinkInertia(Effect):
    """The parameters are what the link has beside the model's. Of the ten those are zero that a motion cannot tell
    from others of the same link, whatever it is: their columns are zero."""

    name = "link_inertia"
    of_link = True
    units: ClassVar = dict(zip(PARAMETERS, UNITS, strict=True))
    confused_with = ("payload", "rotor_inertia", "torque_constant_error")
    experiment = "move {joint} and the joints around it alone, each at two accelerations and through gravity"

    def places(self, body: RigidBody) -> list[Place]:
        return [Place(joint) for joint in range(body.n)]

    def rows(self, body: RigidBody, place: Place) -> tuple[int, ...]:
        assert place.joint is not None
        return body.ancestors(place.joint)

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        assert place.joint is not None
        span = slice(10 * place.joint, 10 * place.joint + 10)
        columns = signals.regressor[:, self.rows(signals.body, place), span]
        columns[:, :, ~signals.distinguishable[place.joint]] = 0.0
        return np.asarray(columns)

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return dict(zip(PARAMETERS, map(float, coefficients), strict=True))

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        return np.zeros(0), np.array([parameters[name] for name in PARAMETERS], dtype=float)

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        assert place.joint is not None
        plant.parameters[10 * place.joint : 10 * place.joint + 10] += self.unknowns(place, parameters)[1]


EFFECT = LinkInertia()
