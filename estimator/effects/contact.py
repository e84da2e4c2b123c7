"""Contact: for a while, or at a place, something pushes on the arm."""

from __future__ import annotations

from collections.abc import Mapping
from itertools import product
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray

from estimator.effects.effect import Effect, Parameters, Place
from estimator.effects.signals import Scales, Signals
from estimator.rigid_body import RigidBody
from estimator.twin.plant import PlantDraft, Push, Wall

Array = NDArray[np.float64]

TIME, PLACE = 0.0, 1.0
"""Whether it comes and goes with time, or with where the last link is: an entry of theta."""
SHARES = 12
"""The recording's halves of windows: those tried are two of them long and begin at each."""
EDGE = 0.02
"""s over which the force comes and goes."""
DEPTHS = (0.15, 0.35, 0.6)
"""Of the way that the last link makes along a wall's normal, what lies behind the wall, where one is tried first."""

TURN = 0.4
"""rad between two directions of walls, half of it: the farthest that a wall between them is turned."""
DEEPER = 2.0
"""Likewise, of what lies behind the walls that are tried, the ratio of two."""

STILL = 1e-3
"""Of the largest spread of where the last link goes, below which it does not move along a direction."""


class Contact(Effect):
    """A force on the arm, in the base's frame, at the origin of the last link.

    At a time: constant, ``force`` (3,) N. theta holds from when until when, s since the recording's start.
    At a place: what a compliant wall pushes back with, ``force`` (3,) N for each metre behind it, along its normal;
    ``where`` (3,) m is the point of its plane nearest to the base's origin; across a plane that the link never leaves
    nothing tells which way it leans, and it is said to stand upright on that. theta holds the direction into the wall
    (of any length) and how far along it the plane lies, m.
    """

    name = "contact"
    units: ClassVar = {"where": "s", "force": "N"}
    choices = (0,)
    comes_and_goes = True
    sought = True
    confused_with = ("load_dependent_friction", "friction_drift")
    experiment = "play the same path again, shifted by 5 cm"

    def units_of(self, parameters: Parameters) -> Mapping[str, str]:
        return {"where": "m", "force": "N/m"} if _at_place(parameters) else self.units

    def places(self, body: RigidBody) -> list[Place]:
        return [Place()]

    def grid(self, place: Place, scales: Scales) -> Array:
        starts = np.arange(SHARES - 1) * scales.duration / SHARES
        nothing = np.zeros_like(starts)
        times = [np.full_like(starts, TIME), starts, starts + 2.0 * scales.duration / SHARES, nothing, nothing]
        ways = _ways(scales.tip)
        along = scales.tip @ ways.T
        furthest, nearest = along.max(axis=0), along.min(axis=0)
        walls = [
            np.column_stack([np.full(len(ways), PLACE), ways, furthest - share * (furthest - nearest)])
            for share in DEPTHS
        ]
        return np.vstack([np.stack(times, axis=1), *walls])

    def around(self, place: Place, scales: Scales, theta: Array, share: float) -> Array:
        """Walls that are turned, or deeper, or less deep, and never so deep that they are hardly walls."""
        if not _is_wall(theta):
            return np.zeros((0, len(theta)))
        normal, distance = _plane(theta)
        depth = float((scales.tip @ normal).max()) - distance
        aside = [axis - (axis @ normal) * normal for axis in _moved(scales.tip)]
        turns = [_unit(way) for way in aside if np.linalg.norm(way) > STILL]
        angle = TURN * share
        ways = [normal, *(_unit(normal + sign * np.tan(angle) * turn) for turn in turns for sign in (-1.0, 1.0))]
        result = []
        for way, deeper in product(ways, (-share, 0.0, share)):
            along = scales.tip @ way
            behind = min(depth * DEEPER**deeper, DEPTHS[-1] * float(np.ptp(along)))
            result.append(np.array([PLACE, *way, along.max() - behind]))
        return np.array(result)

    def columns(self, place: Place, signals: Signals, theta: Array) -> Array:
        if _is_wall(theta):
            normal, distance = _plane(theta)
            depth = np.maximum(signals.tip @ normal - distance, 0.0)
            return np.asarray((depth[:, None] * (signals.reach @ normal))[:, :, None])
        start, end = map(float, theta[1:3])
        during = 0.5 * (np.tanh((signals.t - start) / EDGE) - np.tanh((signals.t - end) / EDGE))
        return np.asarray(-during[:, None, None] * signals.reach)

    def limits(self, place: Place, scales: Scales, theta: Array) -> tuple[Array, Array]:
        """A wall does not pull."""
        if _is_wall(theta):
            return np.zeros(1), np.full(1, np.inf)
        return np.full(3, -np.inf), np.full(3, np.inf)

    def redundant(self, theta: Array) -> int:
        """Of a wall, where it is and which way it pushes: both are along its normal."""
        return 2 if _is_wall(theta) else 0

    def parameters(self, place: Place, theta: Array, coefficients: Array) -> Parameters:
        if _is_wall(theta):
            normal, distance = _plane(theta)
            return {"where": distance * normal + 0.0, "force": -float(coefficients[0]) * normal + 0.0}
        return {"where": np.array(theta[1:3]), "force": np.array(coefficients)}

    def unknowns(self, place: Place, parameters: Parameters) -> tuple[Array, Array]:
        where, force = (np.array(parameters[name], dtype=float) for name in ("where", "force"))
        if not _at_place(parameters):
            return np.array([TIME, *where, 0.0, 0.0]), force
        stiffness = float(np.linalg.norm(force))
        normal = -force / stiffness if stiffness > 0.0 else np.array([1.0, 0.0, 0.0])
        return np.array([PLACE, *normal, normal @ where]), np.array([stiffness])

    def simulate(self, place: Place, parameters: Parameters, plant: PlantDraft) -> None:
        theta, coefficients = self.unknowns(place, parameters)
        if _is_wall(theta):
            normal, distance = _plane(theta)
            plant.walls.append(Wall(normal, distance, float(coefficients[0])))
        else:
            plant.pushes.append(Push(coefficients, float(theta[1]), float(theta[2])))


def _ways(tip: Array) -> Array:
    """(ways, 3) unit vectors in all directions in which the last link, at ``tip`` (samples, 3) m, moves."""
    moved = _moved(tip)
    ways = np.array(list(product((-1.0, 0.0, 1.0), repeat=3))) @ moved.T @ moved
    lengths = np.linalg.norm(ways, axis=1)
    ways = ways[lengths > STILL] / lengths[lengths > STILL, None]
    # As they come, but for rounding, and none twice.
    _, first = np.unique(np.round(ways, 9) + 0.0, axis=0, return_index=True)
    return np.asarray(np.round(ways[np.sort(first)], 12) + 0.0)


def _moved(tip: Array) -> Array:
    """(k, 3) unit vectors, across each other, along which the last link moves, at ``tip`` (samples, 3) m."""
    _, sizes, axes = np.linalg.svd(tip - tip.mean(axis=0), full_matrices=False)
    return np.asarray(axes[sizes > STILL * sizes[0]] if sizes[0] > 0.0 else axes[:0])


def _unit(vector: Array) -> Array:
    return np.asarray(vector / np.linalg.norm(vector))


def _is_wall(theta: Array) -> bool:
    """What lies between the kinds, as when an error is propagated, is the nearer one."""
    return bool(theta[0] > 0.5 * (TIME + PLACE))


def _at_place(parameters: Parameters) -> bool:
    """A time is two numbers, a place three."""
    return np.size(parameters["where"]) == 3


def _plane(theta: Array) -> tuple[Array, float]:
    """Unit vector (3,) into the wall, and how far along it the plane lies from the base's origin, m; no direction is no
    wall."""
    return theta[1:4] / max(float(np.linalg.norm(theta[1:4])), 1e-300), float(theta[4])


EFFECT = Contact()
