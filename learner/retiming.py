"""Re-timing a motion to the arm's limits (Section 7.3): the same path, as fast as torque and speed limits allow.

Along a path q(s) the torque is linear in the path's acceleration and in the square of its speed (Bobrow 1985). With
x = ṡ² on a grid, s̈ = dx/ds / 2, all limits are linear in x, and the fastest profile is the greatest feasible x at
every point, so that one linear programme finds it. Friction, which goes with ṡ itself, is of the profile before.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline
from scipy.optimize import Bounds, LinearConstraint, milp
from scipy.sparse import coo_array

from config import InputError
from learner.inverse_model import InverseModel

Array = NDArray[np.float64]
GRID = 160
ROUNDS = 4
SLOWEST = 1e-6
"""Of x at the ends, where the arm is at rest: a time must remain finite."""


@dataclass(frozen=True)
class PathLimits:
    """(n,) each: N·m, rad/s, rad/s². Take off the torque what the servo needs for its tracking error beforehand."""

    torque: Array
    speed: Array
    acceleration: Array


@dataclass(frozen=True)
class Retimed:
    """Samples at even times: ``t`` s, the motion and the torque (samples × n) that the model has for it."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    torque: Array

    @property
    def duration(self) -> float:
        return float(self.t[-1])


def reserve(limit: Array, stiffness: Array, damping: Array, angle_error: Array, speed_error: Array) -> Array:
    """(n,) N·m of ``limit`` left for the plan when the servo answers the measured tracking errors (rad, rad/s)."""
    return np.asarray(limit - stiffness * angle_error - damping * speed_error)


def retime(model: InverseModel, q: Array, limits: PathLimits, period: float, name: str = "motion") -> Retimed:
    """The path through the samples ``q`` (samples × n, rad), from rest to rest, in the least time within the limits.

    Raises InputError when the arm cannot even stand somewhere on the path.
    """
    path = _path(q, name)
    s = np.linspace(0.0, float(path.x[-1]), GRID + 1)
    middle = (s[1:] + s[:-1]) / 2.0
    way, slope, bend = path(middle), path(middle, 1), path(middle, 2)
    still = np.zeros_like(way)
    weight = model.torque(way, still, still)
    _require_standing(np.abs(weight) - limits.torque, middle / s[-1], name)
    push = model.torque(way, still, slope) - weight
    profile = np.full(GRID + 1, 1e-4)
    for _ in range(ROUNDS):
        speed = np.sqrt((profile[1:] + profile[:-1]) / 2.0)[:, None]
        square = np.maximum(speed**2, SLOWEST)
        # Of the torque at this speed everything even in it goes with x; friction, odd in it, is as it was last round.
        ahead = model.torque(way, slope * speed, bend * square)
        back = model.torque(way, -slope * speed, bend * square)
        even, odd = ((ahead + back) / 2.0 - weight) / square, (ahead - back) / 2.0
        profile = _fastest(s[1] - s[0], slope, bend, push, even, weight + odd, limits, name)
    return _played(model, path, s, profile, period)


def _fastest(
    step: float, slope: Array, bend: Array, push: Array, even: Array, rest: Array, limits: PathLimits, name: str
) -> Array:
    """x at the grid's points: the greatest with all limits kept between them."""
    count, n = slope.shape
    k = np.repeat(np.arange(count), n)
    rows = np.arange(count * n)

    def along(by_acceleration: Array, by_square: Array) -> coo_array:
        """by_acceleration·s̈ + by_square·x at each stretch, with s̈ = Δx/(2·step) and x its mean."""
        a, b = by_acceleration.ravel() / (2.0 * step), by_square.ravel() / 2.0
        data, columns = np.concatenate([b - a, b + a]), np.concatenate([k, k + 1])
        return coo_array((data, (np.tile(rows, 2), columns)), shape=(count * n, count + 1))

    top = np.full(count + 1, np.inf)
    fastest = np.min((limits.speed / np.maximum(np.abs(slope), 1e-12)) ** 2, axis=1)
    top[:-1] = np.minimum(top[:-1], fastest)
    top[1:] = np.minimum(top[1:], fastest)
    top[0] = top[-1] = 0.0
    torque, acceleration = np.tile(limits.torque, count), np.tile(limits.acceleration, count)
    found = milp(
        -np.ones(count + 1),
        constraints=[
            LinearConstraint(along(push, even).tocsc(), -torque - rest.ravel(), torque - rest.ravel()),
            LinearConstraint(along(slope, bend).tocsc(), -acceleration, acceleration),
        ],
        bounds=Bounds(np.zeros(count + 1), top),
    )
    if not found.success:
        raise InputError(name, "cannot be moved within the torque limits", "choose another path or a lighter load")
    return np.asarray(found.x)


def _path(q: Array, name: str) -> CubicSpline:
    """q over the length of the way in joint space; samples at rest are left out."""
    length = np.concatenate([[0.0], np.cumsum(np.linalg.norm(np.diff(q, axis=0), axis=1))])
    if length[-1] <= 0.0:
        raise InputError(name, "does not move", "give a motion")
    # Knots evenly along the way: the samples of a motion from rest crowd at its ends.
    kept = np.concatenate([[True], np.diff(length) > 0.0])
    even = np.linspace(0.0, length[-1], GRID // 2 + 1)
    return CubicSpline(even, np.column_stack([np.interp(even, length[kept], column[kept]) for column in q.T]))


def _require_standing(excess: Array, share: Array, name: str) -> None:
    worst, joint = np.unravel_index(int(np.argmax(excess)), excess.shape)
    if excess[worst, joint] > 0.0:
        raise InputError(
            name,
            f"joint number {joint + 1} lacks {excess[worst, joint]:.3g} N·m to stand at {share[worst]:.2f} of the way",
            "choose another path or a lighter load",
        )


def _played(model: InverseModel, path: CubicSpline, s: Array, x: Array, period: float) -> Retimed:
    """Even samples of the profile; between grid points the path's acceleration is constant."""
    speed = np.sqrt(np.maximum(x, 0.0))
    times = 2.0 * np.diff(s) / np.maximum(speed[1:] + speed[:-1], np.sqrt(SLOWEST))
    at = np.concatenate([[0.0], np.cumsum(times)])
    t = np.arange(int(np.ceil(at[-1] / period)) + 1) * period
    k = np.clip(np.searchsorted(at, t, side="right") - 1, 0, len(times) - 1)
    since = np.minimum(t, at[-1]) - at[k]
    pull = (x[k + 1] - x[k]) / (2.0 * (s[1] - s[0]))
    ds = np.maximum(speed[k] + pull * since, 0.0)
    here = np.minimum(s[k] + speed[k] * since + 0.5 * pull * since**2, s[-1])
    slope, bend = path(here, 1), path(here, 2)
    q, dq, ddq = path(here), slope * ds[:, None], slope * pull[:, None] + bend * (ds**2)[:, None]
    return Retimed(np.asarray(t, dtype=float), q, dq, ddq, model.torque(q, dq, ddq))
