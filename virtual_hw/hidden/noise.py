"""Sensor noise: white noise plus coloured noise (first-order Gauss–Markov), drawn in blocks from a seed.

x_k = w_k + c_k,  c_{k+1} = rho·c_k + sqrt(1 − rho²)·sigma_c·e_k,  rho = exp(−2π·f_c·h)

with w white of standard deviation ``white``, c stationary of standard deviation ``coloured`` and corner f_c.
"""

from __future__ import annotations

import math
from collections.abc import Iterator, Sequence
from itertools import accumulate

import numpy as np

from config.schema import Positive, Section
from virtual_hw.hidden.quantities import NotNegative

BLOCK = 2048
"""Samples drawn at once: numpy's cost per call is spread over so many ticks."""


class Noise(Section):
    """Standard deviations in the unit of the quantity it is added to."""

    white: NotNegative = 0.0
    coloured: NotNegative = 0.0
    corner_hz: Positive = 5.0


SILENT = Noise()


def noise_rows(channels: Sequence[Noise], period_s: float, seed: int, stream: int) -> Iterator[list[float]]:
    """Endless rows of one sample a channel, every ``period_s``; the same for the same ``seed`` and ``stream``."""
    rng = np.random.default_rng([seed, stream])
    white = np.array([c.white for c in channels])
    rho = np.array([math.exp(-2.0 * math.pi * c.corner_hz * period_s) for c in channels])
    drive = np.array([c.coloured for c in channels]) * np.sqrt(1.0 - rho**2)
    coloured = np.array([c.coloured for c in channels]) * rng.standard_normal(len(channels))
    while True:
        block = rng.standard_normal((BLOCK, len(channels))) * white
        for k in np.flatnonzero(drive):
            walk = _walk(float(rho[k]), float(coloured[k]), (drive[k] * rng.standard_normal(BLOCK)).tolist())
            coloured[k] = walk[-1]
            block[:, k] += walk
        yield from block.tolist()


def _walk(rho: float, before: float, steps: list[float]) -> list[float]:
    """x_k = rho·x_{k−1} + step_k, from ``before`` on. In plain Python: scipy.signal takes seconds to import."""
    return list(accumulate(steps, lambda x, step: rho * x + step, initial=before))[1:]
