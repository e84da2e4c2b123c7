"""A motion as samples at the loop's rate."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from config.errors import InputError
from config.motion.curves import Array
from config.motion.files import Motion


@dataclass(frozen=True)
class SampledMotion:
    """``t`` (samples, s from 0) and ``q``, ``dq``, ``ddq`` (samples × joints; rad, rad/s, rad/s²)."""

    t: Array
    q: Array
    dq: Array
    ddq: Array
    name: str = "motion"

    @property
    def duration_s(self) -> float:
        return float(self.t[-1] - self.t[0])


def sample(motion: Motion, rate_hz: float) -> SampledMotion:
    """``motion`` at ``rate_hz``, both ends included; a last part of a period is filled by holding the end.

    Derivatives are those of the curve, not differences. Raises InputError for a rate that is not positive.
    """
    if not rate_hz > 0 or not np.isfinite(rate_hz):
        raise InputError(f"motion {motion.name}", f"cannot be sampled at {rate_hz} Hz", "give a positive rate")
    periods = int(np.ceil(motion.duration_s * rate_hz - 1e-9))
    t = np.arange(periods + 1) / rate_hz
    q, dq, ddq = motion.curve.evaluate(t)
    return SampledMotion(t, q, dq, ddq, motion.name)
