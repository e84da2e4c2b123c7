"""Whether a wrist sensor's channels can be read as they stand: cut off, dead, with holes."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.plausibility.cut_off import cut_off, dead

Array = NDArray[np.float64]

_CHANNELS = ("fx", "fy", "fz", "nx", "ny", "nz")
_JITTER_PERIODS = 3.5
"""A pause longer than that many periods is a gap."""


def readable_wrench(name: str, wrench_t: Array, wrench: Array) -> tuple[Array, list[str]]:
    """The sensor's samples with NaN where they say nothing, and a sentence for each reason.

    ``wrench_t`` (k,) s, ``wrench`` (k, 6) N, N·m as recorded. A channel that never changes is dead and is dropped; a
    channel at a flat top saturates, whatever range the sensor is said to have, and what it feels meanwhile is unknown.
    Raises InputError when no channel ever changes.
    """
    usable = np.array(wrench, dtype=float)
    there = np.isfinite(usable).any(axis=0)
    silent = np.asarray(dead(usable) & there)
    if np.all(silent[there]):
        raise InputError(name, "no channel of the wrench ever changes", "check that the wrist sensor is connected")
    told: list[str] = []
    if silent.any():
        usable[:, silent] = np.nan
        told.append(f"{name}: {_listed(silent)} never changes: left out as dead")
    flat = cut_off(usable)
    if flat.any():
        usable[flat.any(axis=1)] = np.nan
        told.append(
            f"{name}: {_listed(np.any(flat, axis=0))} stands at the end of its range in "
            f"{100.0 * np.mean(flat.any(axis=1)):.3g} % of the samples, which are left out"
        )
    missing = int(np.count_nonzero(~np.isfinite(wrench[:, there]).all(axis=1)))
    steps = np.diff(wrench_t)
    gaps = int(np.count_nonzero(steps > _JITTER_PERIODS * np.median(steps))) if len(steps) else 0
    if missing or gaps:
        told.append(f"{name}: {missing} incomplete samples of the wrench and {gaps} gaps are left out")
    return usable, told


def _listed(channels: NDArray[np.bool_]) -> str:
    return ", ".join(name for name, is_so in zip(_CHANNELS, channels, strict=True) if is_so)
