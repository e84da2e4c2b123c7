"""Exact derivatives of torques along a motion, for torques with parameters of their own in every row.

The regressor is linear in ddq and quadratic in dq, and in the angle of a turning joint a trigonometric polynomial: each
of its rows contracts at most three vectors that the joint turns. Such functions have exact derivatives as sums of few
of their values, so one vectorised regressor serves; no step size is chosen, nothing is approximated.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.regressor import torque_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_DEGREE = 3
_TURNS = (2.0 * np.arange(1, 2 * _DEGREE + 1) - 1.0) * np.pi / (2.0 * _DEGREE)
_TURN_WEIGHTS = (-1.0) ** np.arange(2 * _DEGREE) / (4.0 * _DEGREE * np.sin(_TURNS / 2.0) ** 2)
"""f'(x) = Σ w_k f(x + turn_k) for trigonometric polynomials of degree 3 (the shift rule; Wierichs et al. 2022)."""
_SHIFTS, _SHIFT_WEIGHTS = np.array([-2.0, -1.0, 1.0, 2.0]), np.array([1.0, -8.0, 8.0, -1.0]) / 12.0
"""The same for polynomials up to degree 4: sliding joints."""


def slopes(body: RigidBody, weights: Array, q: Array, dq: Array, ddq: Array) -> tuple[Array, Array, Array]:
    """Derivatives (samples, n) by q, dq and ddq of each sample's Σ weights · regressor.

    ``weights`` (samples, n, 10·n) on the regressor's entries.
    """
    n, units = body.n, np.eye(body.n)
    moves: list[tuple[int, int, Array, float]] = [(2, joint, units[joint], 1.0) for joint in range(n)]
    for joint, axis in enumerate(body.axes):
        shifts, factors = (_TURNS, _TURN_WEIGHTS) if axis.revolute else (_SHIFTS, _SHIFT_WEIGHTS)
        moves += [(0, joint, s * units[joint], float(w)) for s, w in zip(shifts, factors, strict=True)]
        moves += [(1, joint, s * units[joint], 0.5 * s) for s in (-1.0, 1.0)]
    # All shifted motions in one call: the regressor is quick on many samples.
    channels = [np.repeat(channel[None], len(moves) + 1, axis=0) for channel in (q, dq, ddq)]
    for k, (which, _, shift, _) in enumerate(moves, 1):
        channels[which][k] += shift
    regressor = torque_regressor(body, *(channel.reshape(-1, n) for channel in channels))
    values = np.einsum("tip,stip->st", weights, regressor.reshape(len(moves) + 1, *weights.shape))
    result = np.zeros((3, *q.shape))
    for value, (which, joint, _, factor) in zip(values[1:], moves, strict=True):
        result[which, :, joint] += factor * value
    result[2] -= values[0][:, None]
    return result[0], result[1], result[2]
