"""D-optimal motions: the largest determinant of the information matrix that an arm's limits allow.

The determinant is raised by gradient with a growing penalty on what goes beyond the limits, from several seeded starts;
what is still beyond in the end is taken back by shrinking the motion about its centre, so that the limits hold.
"""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.optimize import minimize

from config import InputError
from estimator.excitation.basis import MotionBasis
from estimator.excitation.information import Information
from estimator.excitation.limits import MotionLimits

Array = NDArray[np.float64]

_PENALTIES = (1e2, 1e3, 1e4)
"""Of the mean square excess, in units of log det."""
_ITERATIONS = 60
_MARGIN = 0.97
"""Share of the limits that is used: between the samples a motion goes a little further."""
_FIRST_SIZE = 0.5
_SHRINKINGS = 400
"""By a fiftieth each: enough to stand still in the end."""


@dataclass(frozen=True)
class DesignedMotion:
    """``coefficients`` (m, n) of its basis; ``log_determinant`` and ``standard_errors`` (rank,) of the base parameters
    over ``seconds`` of it; ``use`` is the largest use of any limit."""

    basis: MotionBasis
    coefficients: Array
    log_determinant: float
    standard_errors: Array
    seconds: float
    use: float


def design(
    information: Information,
    basis: MotionBasis,
    limits: MotionLimits,
    seconds: float,
    seed: int = 0,
    starts: int = 2,
) -> DesignedMotion:
    """The best motion of ``basis`` found from ``starts`` seeded starts, to be played for ``seconds``.

    Raises InputError when not even standing still in `MotionLimits.centre` keeps the limits.
    """
    random = np.random.default_rng(seed)
    found = [
        _from(information, basis, limits, seconds, first)
        for first in _starts(information, basis, limits, random, starts)
    ]
    return max(found, key=lambda motion: motion.log_determinant)


def random_motion(
    information: Information, basis: MotionBasis, limits: MotionLimits, seconds: float, seed: int
) -> DesignedMotion:
    """A random motion of the basis, as large as the limits allow: what a design is measured against."""
    (first,) = _starts(information, basis, limits, np.random.default_rng(seed), 1)
    grown = _within(information, basis, limits, basis.towards_centre(first, 1.0 / _FIRST_SIZE**2))
    return _judged(information, basis, limits, seconds, grown)


def judge(
    information: Information, limits: MotionLimits, q: Array, dq: Array, ddq: Array, seconds: float
) -> tuple[float, Array, float]:
    """log det, standard errors (rank,) and use of the limits of any motion, a designed one or another."""
    sign_and_log = np.linalg.slogdet(information.matrix(q, dq, ddq, seconds))
    errors = information.standard_errors(q, dq, ddq, seconds)
    return float(sign_and_log[1]), errors, limits.worst(information.body, q, dq, ddq)


def _starts(
    information: Information, basis: MotionBasis, limits: MotionLimits, random: np.random.Generator, count: int
) -> list[Array]:
    half = (limits.upper - limits.lower) / 2.0
    still = np.outer(basis.centre, limits.centre)
    if limits.worst(information.body, *basis.motion(still)) > 1.0:
        raise InputError(
            "limits",
            "do not allow to stand still in the pose that the motion is designed about",
            "raise the torque limits or lower the floor",
        )
    result = []
    for _ in range(count):
        shape = random.normal(size=still.shape) * half
        size = max(limits.worst(information.body, *basis.motion(still + 1e-3 * shape)), 1e-3)
        # The use grows with the amplitude: what the smallest limit allows is found by halving and doubling.
        amplitude = 1e-3 / size
        while limits.worst(information.body, *basis.motion(still + 2.0 * amplitude * shape)) < 1.0:
            amplitude *= 2.0
        result.append(still + _FIRST_SIZE * amplitude * shape)
    return result


def _from(
    information: Information, basis: MotionBasis, limits: MotionLimits, seconds: float, first: Array
) -> DesignedMotion:
    body, shape = information.body, first.shape
    scale = (limits.upper - limits.lower) / 2.0
    inner = replace(
        limits,
        lower=(limits.upper + limits.lower) / 2.0 - _MARGIN * scale,
        upper=(limits.upper + limits.lower) / 2.0 + _MARGIN * scale,
        velocity=_MARGIN * limits.velocity,
        acceleration=_MARGIN * limits.acceleration,
        torque=None if limits.torque is None else _MARGIN * limits.torque,
    )

    def cost(flat: Array, weight: float) -> tuple[float, Array]:
        q, dq, ddq = basis.motion(flat.reshape(shape) * scale)
        value, by = information.log_determinant(q, dq, ddq, seconds)
        excess, by_excess = inner.penalty(body, q, dq, ddq)
        slope = sum(
            (
                columns.T @ (weight * e - d)
                for columns, d, e in zip((basis.q, basis.dq, basis.ddq), by, by_excess, strict=True)
            ),
            np.zeros(shape),
        )
        return weight * excess - value, (slope * scale).ravel()

    flat = (first / scale).ravel()
    for weight in _PENALTIES:
        flat = minimize(cost, flat, (weight,), "L-BFGS-B", jac=True, options={"maxiter": _ITERATIONS}).x
    return _judged(
        information, basis, limits, seconds, _within(information, basis, limits, flat.reshape(shape) * scale)
    )


def _within(information: Information, basis: MotionBasis, limits: MotionLimits, coefficients: Array) -> Array:
    """The motion shrunk about its own centre, and that drawn to where the limits let stand, until the limits hold."""
    for _ in range(_SHRINKINGS):
        if limits.worst(information.body, *basis.motion(coefficients)) <= 1.0:
            break
        coefficients = basis.towards_centre(coefficients, 0.98)
        pose = basis.pose(coefficients)
        coefficients = coefficients + np.outer(basis.centre, 0.02 * (limits.centre - pose))
    return coefficients


def _judged(
    information: Information, basis: MotionBasis, limits: MotionLimits, seconds: float, coefficients: Array
) -> DesignedMotion:
    motion = basis.motion(coefficients)
    value, errors, use = judge(information, limits, *motion, seconds)
    return DesignedMotion(basis, coefficients, value, errors, seconds, use)
