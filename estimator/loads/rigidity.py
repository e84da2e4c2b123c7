"""Is the load a rigid body? Judged from what a rigid body's fit leaves, against noise that was measured apart from it.

The noise comes from repeats of one motion (what differs between them is noise, what stays is lack of fit) or else from
the same recordings at rest. Residuals alone cannot tell noise from a fault, so without either the answer is withheld.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import f as fisher

from estimator.loads.fit import LoadFit

Array = NDArray[np.float64]

SIGNIFICANCE = 0.01
"""Chance of calling a rigid load not rigid."""
_TOLERANCE = 0.02
"""Share of the load's own wrench that errors of the kinematics and the sensor's own give may leave."""
_SAME_MOTION = 0.05
"""Relative difference of the predicted wrenches below which two recordings are repeats."""
_LEAST_FREE = 10.0
_LAGS = 8


@dataclass(frozen=True)
class ResidualRows:
    """Of one recording, (channels, rows): what is left, and what the load explains; ``still`` (rows,) at rest."""

    left: Array
    explained: Array
    still: NDArray[np.bool_]


@dataclass(frozen=True)
class Rigidity:
    """``p_value`` None when untested; ``detectable``: share of the load's wrench that is found in half of the cases."""

    verdict: Literal["rigid", "not rigid", "untested"]
    p_value: float | None
    noise_from: Literal["repeats", "rest", "nothing"]
    detectable: float | None
    reason: str = ""


def rigidity(residuals: Sequence[ResidualRows], fit: LoadFit, names: Sequence[str]) -> Rigidity:
    """F-test of the residual against pure noise in each channel, Bonferroni over channels.

    Degrees of freedom count only independent rows (coloured noise). An excess below a fiftieth of the load's own
    wrench is put down to the kinematics.
    """
    fitted = len(fit.value) / len(fit.power)
    explained = np.hstack([r.explained for r in residuals])
    allowed = _TOLERANCE**2 * explained.var(axis=1)
    size = explained.var(axis=1)
    groups = _repeats(residuals)
    if groups:
        compared = [_against_repeats([residuals[k].left for k in group], fitted) for group in groups]
        return _verdict(_pooled(compared), allowed, size, "repeats")
    still = np.concatenate([r.still for r in residuals])
    left = np.hstack([r.left for r in residuals])
    quiet, moving = left[:, still], left[:, ~still]
    reason = f"repeat a motion, or record some seconds of rest with it (in {', '.join(names)})"
    if quiet.shape[1] < _LEAST_FREE or moving.shape[1] <= fitted + _LEAST_FREE:
        return Rigidity("untested", None, "nothing", None, reason)
    # Offsets are fitted to moving and still rows alike: their own small error must not pass for noise.
    quiet = quiet - quiet.mean(axis=1, keepdims=True)
    share = _independent(quiet)
    free_quiet = share * quiet.shape[1] - 1.0
    free_moving = share * (moving.shape[1] - fitted)
    if free_quiet.min() < _LEAST_FREE or free_moving.min() < 1.0:
        return Rigidity("untested", None, "nothing", None, reason)
    noise = (quiet**2).sum(axis=1) / (quiet.shape[1] - 1.0 / share)
    power = (moving**2).sum(axis=1) / (moving.shape[1] - fitted)
    return _verdict(_Compared(power, free_moving, noise, free_quiet), allowed, size, "rest")


@dataclass(frozen=True)
class _Compared:
    """(channels,) each: mean square of residual and of noise, with their degrees of freedom."""

    power: Array
    free: Array
    noise: Array
    free_noise: Array


def _verdict(compared: _Compared, allowed: Array, size: Array, noise_from: Literal["repeats", "rest"]) -> Rigidity:
    null = np.maximum(compared.noise + allowed, np.finfo(float).tiny)
    p_values = np.asarray(fisher.sf(compared.power / null, compared.free, compared.free_noise))
    p_value = float(min(1.0, p_values.min() * len(p_values)))
    limit = fisher.isf(SIGNIFICANCE / len(p_values), compared.free, compared.free_noise)
    excess = np.sqrt(np.maximum(limit * null - compared.noise, 0.0) / np.maximum(size, np.finfo(float).tiny))
    verdict: Literal["rigid", "not rigid"] = "not rigid" if p_value < SIGNIFICANCE else "rigid"
    return Rigidity(verdict, p_value, noise_from, float(excess.min()))


def _repeats(residuals: Sequence[ResidualRows]) -> list[list[int]]:
    """Groups of two or more recordings of one motion."""
    groups: list[list[int]] = []
    for k, mine in enumerate(residuals):
        for group in groups:
            first = residuals[group[0]].explained
            if first.shape == mine.explained.shape and first.size:
                difference = np.linalg.norm(first - mine.explained)
                scale = np.linalg.norm(first - first.mean(axis=1, keepdims=True))
                if difference < _SAME_MOTION * scale:
                    group.append(k)
                    break
        else:
            groups.append([k])
    return [group for group in groups if len(group) > 1]


def _against_repeats(left: Sequence[Array], fitted: float) -> _Compared:
    stack = np.array(left)
    repeats, _, rows = stack.shape
    mean = stack.mean(axis=0)
    scatter = stack - mean
    share = np.mean([_independent(x) for x in scatter], axis=0)
    free = np.maximum(share * (rows - fitted), 1.0)
    free_noise = (repeats - 1) * share * rows
    power = repeats * (mean**2).sum(axis=1) / max(rows - fitted, 1.0)
    return _Compared(power, free, (scatter**2).sum(axis=(0, 2)) / ((repeats - 1) * rows), free_noise)


def _pooled(parts: Sequence[_Compared]) -> _Compared:
    free, free_noise = sum(p.free for p in parts), sum(p.free_noise for p in parts)
    power = sum(p.power * p.free for p in parts) / free
    noise = sum(p.noise * p.free_noise for p in parts) / free_noise
    return _Compared(np.asarray(power), np.asarray(free), np.asarray(noise), np.asarray(free_noise))


def _independent(x: Array) -> Array:
    """(channels,): independent values a row, for a variance: 1 / (1 + 2·Σ ρ²), significant correlations alone."""
    count = x.shape[1]
    centred = x - x.mean(axis=1, keepdims=True)
    variance = np.maximum((centred**2).sum(axis=1), np.finfo(float).tiny)
    total = np.ones(len(x))
    for lag in range(1, min(_LAGS, count // 4) + 1):
        correlation = (centred[:, lag:] * centred[:, :-lag]).sum(axis=1) / variance
        total += 2.0 * np.where(correlation**2 > 4.0 / count, correlation**2, 0.0)
    return np.asarray(1.0 / total)
