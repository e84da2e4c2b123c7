"""Local models (Section 7.1): what practice learnt of one motion, carried over to motions near it.

The named effects come first, in the model. What is left of the correction is interpolated by locally weighted
regression in the space of the joint's own angle, velocity and acceleration and, more loosely, of the others'. The
trust gate goes over to the model alone where no trial has been: there a regression would only make something up.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.spatial import cKDTree

from config import InputError

Array = NDArray[np.float64]
OWN_ANGLE, OWN_SPEED, OTHERS = 0.0025, 0.5, 1.0
"""Kernel widths as shares of the ranges in the trials: the joint's own angle (ripple and cogging live there), its own
velocity; the other joints' angles and velocities, and all accelerations."""
REACH = 8.0
"""Times the own angle's width for the trust: what lies a little outside the practised range takes its edge's value."""
DIRECTION, SLOW = 0.3, 0.02
"""Width of the joint's direction, from −1 to 1, and the share of its top speed below which it counts as undecided: what
friction taught one way is nothing to go by the other way, nor at rest."""
NEIGHBOURS = 20
FULL_TRUST, NO_TRUST = 1.0, 3.0
"""Distances, in widths, to the nearest samples: within the first the regression counts fully, beyond the second not."""
RIDGE = 0.1
"""Of the slopes, in widths: a plane through neighbours on one line is tilted by the line alone."""


@dataclass(frozen=True)
class States:
    """Where an arm is and how it moves: (samples, n) rad, rad/s, rad/s²."""

    q: Array
    dq: Array
    ddq: Array


class LocalModel:
    """``correction`` (samples × n, N·m): what practice added to the model's torque at ``states``.

    Raises InputError when the arrays do not belong together.
    """

    def __init__(self, states: States, correction: Array) -> None:
        if correction.shape != states.q.shape:
            raise InputError(
                "local model",
                f"correction has shape {correction.shape}, the motion {states.q.shape}",
                "give one motion",
            )
        joints = range(states.q.shape[1])
        self._slow = np.maximum(SLOW * np.abs(states.dq).max(axis=0), 1e-9)
        self._widths = [_widths(states, joint, self._slow[joint]) for joint in joints]
        moving = [np.abs(states.dq[:, joint]) >= self._slow[joint] for joint in joints]
        self._values = [correction[moving[joint], joint] for joint in joints]
        self._points = [
            (_features(states, joint, self._slow[joint]) / self._widths[joint])[moving[joint]] for joint in joints
        ]
        self._trees = [cKDTree(points) for points in self._points]
        self._known = [cKDTree(_reaching(points)) for points in self._points]

    def correction_at(self, states: States) -> tuple[Array, Array]:
        """(correction in N·m, already weighted by trust; trust from 0 to 1) at other states, (samples, n) each."""
        found, trust = np.zeros_like(states.q), np.zeros_like(states.q)
        for joint, (width, points, tree) in enumerate(zip(self._widths, self._points, self._trees, strict=True)):
            if not len(points):
                continue  # it never moved while the others were practised
            asked = _features(states, joint, self._slow[joint]) / width
            count = min(NEIGHBOURS, len(points))
            distances, nearest = tree.query(asked, k=count)
            distance = np.asarray(distances, dtype=float).reshape(len(asked), count)
            near = np.asarray(nearest).reshape(len(asked), count)
            weight = np.exp(-0.5 * (distance**2 - distance[:, :1] ** 2))
            values = _planes(points[near] - asked[:, None, :], self._values[joint][near], weight)
            # A plane may extrapolate; what the neighbours themselves needed bounds it.
            span = self._values[joint][near]
            away = np.asarray(self._known[joint].query(_reaching(asked))[0], dtype=float)
            trust[:, joint] = np.clip((NO_TRUST - away) / (NO_TRUST - FULL_TRUST), 0.0, 1.0)
            found[:, joint] = trust[:, joint] * np.clip(values, span.min(axis=1), span.max(axis=1))
        return found, trust


def _features(states: States, joint: int, slow: float) -> Array:
    others = [k for k in range(states.q.shape[1]) if k != joint]
    own = [states.q[:, joint], states.dq[:, joint], np.tanh(states.dq[:, joint] / slow)]
    return np.column_stack([*own, states.q[:, others], states.dq[:, others], states.ddq])


def _widths(states: States, joint: int, slow: float) -> Array:
    span = np.maximum(np.ptp(_features(states, joint, slow), axis=0), 1e-9)
    share = np.full(len(span), OTHERS)
    share[:2] = OWN_ANGLE, OWN_SPEED
    widths = span * share
    widths[2] = DIRECTION
    return np.asarray(widths)


def _reaching(points: Array) -> Array:
    """Points for the trust: with the joint's own angle `REACH` times as wide."""
    return np.asarray(points / np.array([REACH, *np.ones(points.shape[1] - 1)]))


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
