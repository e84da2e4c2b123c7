"""Maps: what a residual torque depends on when no law of the catalogue explains it.

A map is any function of one quantity, straight between a few knots, or any memory of the way since reversals. It has no
physical parameter; it tells where the unexplained lives.
"""

from __future__ import annotations

from collections.abc import Mapping
from itertools import pairwise
from typing import ClassVar

import numpy as np
from numpy.polynomial.legendre import legvander
from numpy.typing import NDArray

from estimator.effects import Law, Parameters, Place, Scales, Signals
from estimator.effects.effect import SeenAgainst
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

SEEN: Mapping[str, SeenAgainst] = {
    "angle": "q",
    "speed": "dq",
    "acceleration": "ddq",
    "torque": "tau",
    "time": "t",
    "temperature": "temperature",
    "friction along the temperature": "temperature",
}
_KNOTS = 8
MEMORY = "travel since reversals"
_REACH = 2.5
"""rms speeds, accelerations, torques to which a map reaches."""
_LEAST_REACH = 1e-6
"""rad, of a joint that stands."""


class Map(Law):
    """Torque of a joint as a function of one quantity, its own or each neighbour's."""

    units: ClassVar = {}
    experiment = "repeat the motion at another speed"

    def __init__(self, quantity: str, of_neighbour: bool = False) -> None:
        self.quantity, self.of_neighbour = quantity, of_neighbour
        self.name = f"map of {quantity}"  # type: ignore[misc]
        self.seen_against = SEEN.get(quantity, "law")  # type: ignore[misc]

    def places(self, body: RigidBody) -> list[Place]:
        if not self.of_neighbour:
            return [Place(joint) for joint in range(body.n)]
        pairs = [(joint, joint + step) for joint in range(body.n) for step in (-1, 1)]
        return [Place(joint, other=other) for joint, other in pairs if 0 <= other < body.n]

    def told_of(self, body: RigidBody, scales: Scales) -> list[Place]:
        """`places` where its quantity was recorded, and changes."""
        known = "temperature" not in self.quantity
        return [place for place in self.places(body) if known or scales.warms(self.source(place))]

    @staticmethod
    def source(place: Place) -> int:
        """The joint whose quantity it is."""
        joint = place.joint if place.other is None else place.other
        assert joint is not None
        return joint

    def grid(self, place: Place, scales: Scales) -> Array:
        """theta is the knots, so that all recordings share them; of a memory, the widths at which it yields."""
        joint = self.source(place)
        if self.quantity == "time":
            return np.linspace(0.0, scales.duration, _KNOTS)[None]
        if self.quantity == MEMORY:
            reach = max(float(scales.q_high[joint] - scales.q_low[joint]), _LEAST_REACH)
            return np.asarray(reach * 0.5 ** np.arange(_KNOTS, 0, -1))[None]
        if "temperature" in self.quantity:
            return np.linspace(scales.cold[joint], scales.warm[joint], _KNOTS)[None]
        if self.quantity in ("angle", "friction along the angle"):
            return np.linspace(scales.q_low[joint], scales.q_high[joint], _KNOTS)[None]
        rms = {"speed": scales.dq, "acceleration": scales.ddq, "torque": scales.tau}[self.quantity][joint]
        return np.asarray(rms * np.linspace(-_REACH, _REACH, _KNOTS))[None]

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        joint = self.source(place)
        if self.quantity == MEMORY:
            return stops(signals.q[:, joint], theta)[:, None, :]
        channel = self._channel(signals, joint)
        result = hats(channel, theta)
        if self.quantity.startswith("friction along"):
            spread = np.sqrt(np.mean(signals.dq[:, joint] ** 2))
            result *= signals.direction(joint, max(0.02 * float(spread), 1e-9))[:, None]
        if self.quantity == "speed":
            # A jump at rest, as all dry friction has.
            result = np.column_stack([result, np.sign(channel)])
        return result[:, None, :]

    def _channel(self, signals: Signals, joint: int) -> Array:
        """(samples,) the quantity; of a motion that is only planned, a temperature of nothing."""
        against = SEEN.get(self.quantity, "q")
        if against == "t":
            return signals.t
        whole = signals.tau_rigid if against == "tau" else getattr(signals, against)
        return np.zeros(signals.samples) if whole is None else np.asarray(whole[:, joint])

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        return {}


def smoothest_first(columns: int) -> Array:
    """(columns, columns) combinations of a map's coefficients, the smoothest first: polynomials of rising degree, a
    jump at rest, where the map has one, after the straight line."""
    shapes = legvander(np.linspace(-1.0, 1.0, _KNOTS), _KNOTS - 1)
    if columns == _KNOTS:
        return np.asarray(shapes)
    result = np.zeros((columns, columns))
    result[:_KNOTS, [0, 1, *range(3, columns)]] = shapes
    result[_KNOTS:, 2] = 1.0
    return result


def hats(x: Array, knots: Array) -> Array:
    """(samples, knots) weights of straight interpolation between knots; beyond the ends the end knots hold."""
    return np.array([np.interp(x, knots, unit) for unit in np.eye(len(knots))]).T


def stops(q: Array, widths: Array) -> Array:
    """(samples, widths) of elements that follow the angle until they yield at ± their width, and again from each
    reversal on: sums of these are any memory that fades with the way (Prandtl–Ishlinskii), in units of its force."""
    step = np.sign(np.diff(q))
    moving = np.flatnonzero(step)
    result = np.zeros((len(q), len(widths)))
    if not len(moving):
        return result
    turns = moving[1:][step[moving[1:]] != step[moving[:-1]]]
    edges = [int(moving[0]), *turns.tolist(), len(q) - 1]
    for first, last in pairwise(edges):
        run = slice(first, last + 1)
        result[run] = np.clip(result[first] + (q[run] - q[first])[:, None] / widths, -1.0, 1.0)
    return result


MAPS = (
    *(Map(quantity) for quantity in SEEN),
    Map("friction along the angle"),
    Map(MEMORY),
    *(Map(quantity, of_neighbour=True) for quantity in ("angle", "speed")),
)
