"""How far the given model's base parameters may be off before a cause is looked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.consistency import prior_precision
from estimator.diagnosis.observed.stretches import Channel
from estimator.parallel_axis import about_centre, unit_mass_slopes
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_UNTOLD = 1e3
"""Standard deviation of each parameter of a link that the model gives no mass (kg, kg·m, kg·m²)."""
_STIFFEST = 1e-9
"""Share of the widest combination's variance (of normalised parameters) that every other has at least."""

_OF_NUMBERS = 1.0 / 3.0
"""Of the tolerance, the standard deviation of the numbers in a URDF: none is off by more than that."""
_SQUARES = [0, 3, 5]
"""xx, yy and zz among xx xy xz yy yz zz."""
_TIMING = {"torque": 0.25, "velocity": 0.4, "deflection": 0.05}
"""Of a sample: standard deviation of each channel's timing against the angles', which no recording tells exactly (a
speed counted between two samples belongs between them) …"""
_LEAST_TIMING = 0.5e-3
"""… nor below this, s."""


def given_precision(
    body: RigidBody, base: BaseParameters, tolerance: float, channels: Sequence[Channel], rate: float
) -> Array:
    """(rank + channels, …) inverse covariance of all that the given model may be off by; ``rate`` Hz of the slowest
    recording."""
    size = base.rank + len(channels)
    result = np.zeros((size, size))
    result[: base.rank, : base.rank] = base_precision(body, base, tolerance)
    result[base.rank :, base.rank :] = timing_precision(channels, rate)
    return result


def timing_precision(channels: Sequence[Channel], rate: float) -> Array:
    """(channels, channels) inverse covariance of each channel's lateness, of recordings at ``rate`` Hz and more."""
    return np.diag([max(_TIMING[channel.equation] / rate, _LEAST_TIMING) ** -2 for channel in channels])


def base_precision(body: RigidBody, base: BaseParameters, tolerance: float) -> Array:
    """(rank, rank) inverse covariance of the base parameters' deviations under `link_covariance`."""
    spread = base.combination @ link_covariance(body, tolerance) @ base.combination.T
    scale = np.sqrt(np.diag(spread))
    # Bodies that are all but flat or a point leave combinations that may hardly vary: bounded, so that they invert.
    values, vectors = np.linalg.eigh(spread / np.outer(scale, scale))
    kept = np.maximum(values, _STIFFEST * values[-1])
    return np.asarray((vectors / kept) @ vectors.T / np.outer(scale, scale))


def link_covariance(body: RigidBody, tolerance: float) -> Array:
    """(10·n, 10·n) covariance of the inertial parameters, every link's being right to a relative ``tolerance``
    (standard deviation): as a body (`estimator.consistency.prior_precision`), and as the numbers that a URDF has of it
    (`_by_numbers`).

    A link without mass is not modelled at all: its parameters are free.
    """
    covariance = np.zeros((10 * body.n, 10 * body.n))
    for link, parameters in enumerate(body.prior().reshape(-1, 10)):
        span = slice(10 * link, 10 * link + 10)
        if parameters[0] > 0.0:
            covariance[span, span] = np.linalg.inv(prior_precision(parameters, tolerance))
            covariance[span, span] += (_OF_NUMBERS * tolerance) ** 2 * _by_numbers(parameters)
        else:
            covariance[span, span] = _UNTOLD**2 * np.eye(10)
    return covariance


def _by_numbers(parameters: Array) -> Array:
    """(10, 10) covariance of a link's parameters whose centre is off by a distance in each direction, relative to its
    own from the joint, and whose moments and products of inertia are each off by themselves, relative to the moments.

    Bodies of which each number is off by a few per cent are not near each other as bodies are: a long one's far centre
    moves by much more than that share of its radius of gyration, and its thin side is the difference of two moments.
    """
    mass, centre = parameters[0], parameters[1:4] / parameters[0]
    moved = mass * np.vstack([np.zeros(3), np.eye(3), unit_mass_slopes(centre)])
    moments = np.maximum(about_centre(parameters)[_SQUARES], 0.0)
    result = centre @ centre * moved @ moved.T
    result[4:, 4:] += np.diag(np.outer(moments, moments)[np.triu_indices(3)])
    return np.asarray(result)
