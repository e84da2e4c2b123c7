"""Which inertial parameters joint torques can tell: alone, in combination, not at all (thesis, section 4.5).

The numerical rank of the regressor over random motion decides. Columns are offered in an order of preference and kept
when they are independent of those kept before; what is left over is written as their combination. Masses, first
moments along the axis and Ixx are offered last, so that they are what disappears into their neighbours; this is the
form of the thesis' Table 4.3.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator.regressor import torque_regressor
from estimator.rigid_body import PARAMETERS, UNITS, RigidBody

Array = NDArray[np.float64]

_OFFERED_LAST = ("Ixx", "mcz", "m")
_RANK_TOLERANCE = 1e-8
"""Relative to a column's norm; random motion leaves singular values at 1e-15 or above 1e-3."""


@dataclass(frozen=True)
class BaseParameters:
    """The fewest combinations that fix all joint torques: beta = combination · psi, tau = select(K) · beta."""

    names: tuple[str, ...]
    """The combinations in symbols, e.g. ``Izz1 + Ixx2 + Ixx3 + 0.2025 m3``."""
    units: tuple[str, ...]
    kept: tuple[int, ...]
    """The parameter that stands for each combination; its column of K is the combination's, times `sign`."""
    sign: Array
    """(rank,) of +1 and −1: combinations are written with their merged parameters positive."""
    combination: Array
    """(rank, 10·n): beta = combination · psi."""
    alone: tuple[str, ...]
    combined: tuple[str, ...]
    absent: tuple[str, ...]
    """Not identifiable at all: no motion of the joints makes them act on a joint torque."""

    @property
    def rank(self) -> int:
        return len(self.kept)

    def select(self, regressor: Array) -> Array:
        """Base regressor (…, rank) of a full one (…, 10·n)."""
        return np.asarray(regressor[..., list(self.kept)] * self.sign)

    def representative(self, beta: Array) -> Array:
        """Full parameters (10·n,) with these base parameters and zero for all that was merged away or is absent.

        Predicts torques exactly, but is no physically possible body: see `estimator.consistency` for one.
        """
        psi = np.zeros(self.combination.shape[1])
        psi[list(self.kept)] = self.sign * beta
        return psi


def base_parameters(body: RigidBody, seed: int = 0) -> BaseParameters:
    """Base parameters of an arm from its geometry and gravity alone, over random motion of every joint."""
    random = np.random.default_rng(seed)
    samples = max(50, 12 * body.n)
    q = random.uniform(-np.pi, np.pi, (samples, body.n))
    dq, ddq = random.normal(0.0, 2.0, (samples, body.n)), random.normal(0.0, 5.0, (samples, body.n))
    stacked = torque_regressor(body, q, dq, ddq).reshape(-1, 10 * body.n)
    return base_parameters_of(stacked, body.parameter_names)


def base_parameters_of(stacked: Array, names: tuple[str, ...]) -> BaseParameters:
    """Base parameters of a stacked regressor (rows, 10·n): of given motion, when that is what it was made from."""
    norms = np.linalg.norm(stacked, axis=0)
    scale = np.where(norms > 1e-9 * norms.max(initial=0.0), norms, np.inf)
    kept, merged = _independent_columns(stacked / scale, _order_of_preference(len(names)))
    coefficients = np.linalg.lstsq(stacked[:, kept], stacked[:, merged], rcond=None)[0]
    coefficients = np.where(np.abs(coefficients) < 1e-9, 0.0, coefficients)
    combination = np.zeros((len(kept), len(names)))
    combination[np.arange(len(kept)), kept] = 1.0
    combination[:, merged] = coefficients
    sign = np.array([_sign(row) for row in coefficients])
    combination *= sign[:, None]
    shared = np.count_nonzero(combination, axis=1) > 1
    alone = tuple(names[k] for k, is_shared in zip(kept, shared, strict=True) if not is_shared)
    combined = tuple(
        name for column, name in enumerate(names) if np.any(combination[shared, column]) and name not in alone
    )
    absent = tuple(name for name in names if name not in alone and name not in combined)
    return BaseParameters(
        names=tuple(in_symbols(row, names) for row in combination),
        units=tuple(UNITS[k % 10] for k in kept),
        kept=tuple(kept),
        sign=sign,
        combination=combination,
        alone=alone,
        combined=combined,
        absent=absent,
    )


def _order_of_preference(columns: int) -> list[int]:
    def rank(column: int) -> tuple[int, int]:
        symbol = PARAMETERS[column % 10]
        return (1 + _OFFERED_LAST.index(symbol) if symbol in _OFFERED_LAST else 0, column)

    return sorted(range(columns), key=rank)


def _independent_columns(scaled: Array, order: list[int]) -> tuple[list[int], list[int]]:
    """Gram–Schmidt, twice for accuracy: columns to keep (ascending) and columns that depend on them."""
    basis = np.empty((scaled.shape[0], 0))
    kept: list[int] = []
    merged: list[int] = []
    for column in order:
        vector = scaled[:, column].copy()
        if not vector.any():
            continue
        for _ in range(2):
            vector -= basis @ (basis.T @ vector)
        length = np.linalg.norm(vector)
        if length > _RANK_TOLERANCE:
            basis = np.column_stack([basis, vector / length])
            kept.append(column)
        else:
            merged.append(column)
    return sorted(kept), sorted(merged)


def _sign(merged_coefficients: Array) -> float:
    """The sign that makes the heaviest-weighted merged parameter positive; the kept one alone stays as it is."""
    if not merged_coefficients.any():
        return 1.0
    return float(np.sign(merged_coefficients[np.argmax(np.abs(merged_coefficients))]))


def in_symbols(row: Array, names: tuple[str, ...]) -> str:
    """A combination as text, positive terms first: ``Ixx2 + Ixx3 - Iyy2``."""
    terms = sorted((row[k] < 0.0, k) for k in np.flatnonzero(row))
    text = ""
    for negative, k in terms:
        factor = format(abs(row[k]), ".6g")
        term = names[k] if factor == "1" else f"{factor} {names[k]}"
        text += (" - " if negative else " + ") + term
    return text.removeprefix(" + ").replace(" - ", "-", 1) if text.startswith(" - ") else text.removeprefix(" + ")
