"""How far the given model's base parameters may be off before a cause is looked for."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.consistency import prior_precision
from estimator.diagnosis.stretches import Channel
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_UNTOLD = 1e3
"""Standard deviation of each parameter of a link that the model gives no mass (kg, kg·m, kg·m²)."""
_STIFFEST = 1e-9
"""Share of the widest combination's variance (of normalised parameters) that every other has at least."""

_TIMING = {"torque": 0.25, "velocity": 0.4}
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
    """(rank, rank) inverse covariance of the base parameters' deviations, every link's inertial parameters being right
    to a relative ``tolerance`` (standard deviation; see `estimator.consistency.prior_precision`).

    A link without mass is not modelled at all: its parameters are free.
    """
    covariance = np.zeros((10 * body.n, 10 * body.n))
    for link, parameters in enumerate(body.prior().reshape(-1, 10)):
        span = slice(10 * link, 10 * link + 10)
        if parameters[0] > 0.0:
            covariance[span, span] = np.linalg.inv(prior_precision(parameters, tolerance))
        else:
            covariance[span, span] = _UNTOLD**2 * np.eye(10)
    spread = base.combination @ covariance @ base.combination.T
    scale = np.sqrt(np.diag(spread))
    # Bodies that are all but flat or a point leave combinations that may hardly vary: bounded, so that they invert.
    values, vectors = np.linalg.eigh(spread / np.outer(scale, scale))
    kept = np.maximum(values, _STIFFEST * values[-1])
    return np.asarray((vectors / kept) @ vectors.T / np.outer(scale, scale))
