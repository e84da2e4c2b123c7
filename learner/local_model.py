"""Local models (Section 7.1): what practice learnt of one motion, carried over to motions near it.

The named effects come first, in the model. What is left of the correction is interpolated by locally weighted
regression in the space of the joint's own angle, velocity, direction and way since its last reversal and, more loosely,
of the other joints. The trust gate goes over to the model alone where no trial has been: there a regression would only
make something up.

The rests before and after a motion belong to it: what friction holds at rest, and how it lets go, comes of the
direction in which the joint will go or has come.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from config import InputError

Array = NDArray[np.float64]
OWN_ANGLE, OWN_SPEED, OTHERS = 0.05, 0.7, 1.0
"""Kernel widths: of the joint's own angle, as a share of its range in the trials; of the logarithm of its own speed, in
which friction changes most near rest; of the other joints' angles and velocities and of all accelerations, as shares of
their ranges."""
WAY = 0.1
"""Width of the share that is done of the way between two reversals: the two ends of one way may lie at one angle."""
DIRECTION, SLOW = 0.3, 0.02
"""Width of the joint's direction, −1 or 1: what friction taught one way is nothing to go by the other way. The share of
a joint's top speed below which it counts as turning or standing."""
NEIGHBOURS = 20
FULL_TRUST, NO_TRUST = 1.0, 3.0
"""Distances, in widths, to the nearest samples: within the first the regression counts fully, beyond the second not."""
RIDGE = 0.1
"""Of the slopes, in widths: a plane through neighbours on one line is tilted by the line alone."""


@dataclass(frozen=True)
class States:
    """Where an arm is and how it moves along one motion, rests included: (samples, n) rad, rad/s, rad/s²."""

    q: Array
    dq: Array
    ddq: Array


class LocalModel:
    """``correction`` (samples × n, N·m): what practice added to the model's torque along ``states``.

    Raises InputError when the arrays do not belong together.
    """

    def __init__(self, states: States, correction: Array) -> None:
        if correction.shape != states.q.shape:
            raise InputError(
                "local model",
                f"correction has shape {correction.shape}, the motion {states.q.shape}",
                "give one motion",
            )
        self._slow = np.maximum(SLOW * np.abs(states.dq).max(axis=0), 1e-9)
        self._moved = np.ptp(states.q, axis=0) > 0.0
        self._values = correction
        features = [self._features(states, joint) for joint in range(states.q.shape[1])]
        self._widths = [_widths(columns) for columns in features]
        self._points = [columns / width for columns, width in zip(features, self._widths, strict=True)]
        self._trees = [cKDTree(points) for points in self._points]

    def correction_at(self, states: States) -> tuple[Array, Array]:
        """(correction in N·m, already weighted by trust; trust from 0 to 1) along another motion, (samples, n) each."""
        found, trust = np.zeros_like(states.q), np.zeros_like(states.q)
        for joint in np.flatnonzero(self._moved):  # of one that never moved nothing was learnt
            asked = self._features(states, int(joint)) / self._widths[joint]
            points, values = self._points[joint], self._values[:, joint]
            count = min(NEIGHBOURS, len(points))
            distances, nearest = self._trees[joint].query(asked, k=count)
            distance = np.asarray(distances, dtype=float).reshape(len(asked), count)
            near = np.asarray(nearest).reshape(len(asked), count)
            weight = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2))
            planes = _planes(points[near] - asked[:, None, :], values[near], weight)
            # A plane may extrapolate; what the neighbours themselves needed bounds it.
            span = values[near]
            trust[:, joint] = np.clip((NO_TRUST - distance[:, 0]) / (NO_TRUST - FULL_TRUST), 0.0, 1.0)
            found[:, joint] = trust[:, joint] * np.clip(planes, span.min(axis=1), span.max(axis=1))
        return found, trust

    def _features(self, states: States, joint: int) -> Array:
        others = [k for k in range(states.q.shape[1]) if k != joint]
        q, dq, slow = states.q[:, joint], states.dq[:, joint], self._slow[joint]
        direction, way = ways(q, dq, slow)
        own = [q, np.arcsinh(dq / slow), way, direction]
        return np.column_stack([*own, states.q[:, others], states.dq[:, others], states.ddq])


def ways(q: Array, dq: Array, slow: float) -> tuple[Array, Array]:
    """(direction, share of the way done), (samples,) each, of one joint's motion.

    A way leads from one reversal to the next; rests belong to the way that follows, and the last ones to the way that
    has led there. A joint that never goes faster than ``slow`` has direction 0.
    """
    sign = np.where(np.abs(dq) >= slow, np.sign(dq), 0.0)
    going = np.flatnonzero(sign)
    if not going.size:
        return np.zeros_like(q), np.zeros_like(q)
    turns = np.flatnonzero(np.diff(sign[going]) != 0.0)
    # Between two ways it turns where it is slowest.
    ends = [going[k] + int(np.argmin(np.abs(dq[going[k] : going[k + 1] + 1]))) for k in turns]
    direction, done = np.empty_like(q), np.empty_like(q)
    for first, end in zip([0, *ends], [*ends, len(q)], strict=True):
        way = slice(first, end)
        direction[way] = sign[going[np.searchsorted(going, first)]]
        length = np.ptp(q[way])
        done[way] = np.abs(q[way] - q[first]) / length if length > 0.0 else 0.0
    return direction, done


def _widths(features: Array) -> Array:
    widths = OTHERS * np.maximum(np.ptp(features, axis=0), 1e-9)
    widths[:4] = OWN_ANGLE * max(np.ptp(features[:, 0]), 1e-9), OWN_SPEED, WAY, DIRECTION
    return np.asarray(widths)


def _planes(offsets: Array, values: Array, weight: Array) -> Array:
    """Weighted ridge planes through neighbours; their values at the origin, one each query."""
    queries, count, dimensions = offsets.shape
    columns = np.concatenate([np.ones((queries, count, 1)), offsets], axis=2)
    weighted = columns * weight[:, :, None]
    normal = np.einsum("qki,qkj->qij", weighted, columns)
    penalty = np.full(dimensions + 1, RIDGE) * weight.sum(axis=1, keepdims=True)
    penalty[:, 0] = 1e-9
    normal[:, np.arange(dimensions + 1), np.arange(dimensions + 1)] += penalty
    right = np.einsum("qki,qk->qi", weighted, values)
    return np.asarray(np.linalg.solve(normal, right[:, :, None])[:, 0, 0])
