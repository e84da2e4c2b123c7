"""Which of several known loads is it, and is it the one it should be: both with stated error rates."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2, norm

from config import InputError
from estimator.loads.parameters import Measured, RigidLoad

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Recognition:
    """``p_values``: chance that the load of that name lies as far away as what was measured.

    ``unknown`` when none is above ``false_rejection``, ``ambiguous`` when several are. ``confusion``: the most
    probable mistake between the named load and another.
    """

    verdict: Literal["recognised", "ambiguous", "unknown"]
    name: str | None
    p_values: Mapping[str, float]
    false_rejection: float
    confusion: float


CALIBRATION = 0.02
"""Share of a mass or moment by which calibration of sensor and kinematics may be off (one standard error): no noise in
the recordings shows it."""


def recognise(
    load: RigidLoad, known: Sequence[RigidLoad], false_rejection: float = 0.01, calibration: float = CALIBRATION
) -> Recognition:
    """Compares mass and, where told, principal moments: what does not depend on the grip.

    The squared Mahalanobis distance of measured and known load, both with their covariances and ``calibration``'s, is
    chi-squared.
    Raises InputError without known loads, for two of one name, or when not even the mass is told.
    """
    names = [k.name for k in known]
    if not names or len(set(names)) < len(names):
        raise InputError("known loads", "are none, or two have one name", "name each once")
    measured = _invariants(load)
    measured = Measured(measured.value, measured.covariance + _off(measured, calibration))
    if not np.isfinite(measured.value[0]):
        raise InputError(load.name, "its mass is not known", "identify it with more motion first")
    p_values = {k.name: _p_value(measured, _invariants(k)) for k in known}
    best = max(p_values, key=lambda name: p_values[name])
    possible = [name for name, p in p_values.items() if p >= false_rejection]
    mine = _invariants(known[names.index(best)])
    others = [_invariants(k) for k in known if k.name != best]
    # Two loads d standard deviations apart are mistaken for each other with probability Φ(−d/2).
    confusion = max((float(norm.sf(_distance(mine, x, measured.covariance) / 2.0)) for x in others), default=0.0)
    if not possible:
        return Recognition("unknown", None, p_values, false_rejection, confusion)
    verdict: Literal["recognised", "ambiguous"] = "recognised" if len(possible) == 1 else "ambiguous"
    return Recognition(verdict, best, p_values, false_rejection, confusion)


@dataclass(frozen=True)
class Verification:
    """``accepted``: within tolerance but for a chance of at most ``false_acceptance``; ``rejected``: outside, but for
    at most ``false_rejection``; otherwise ``undecided``. ``power``: chance of accepting the very nominal load, at
    least."""

    verdict: Literal["accepted", "rejected", "undecided"]
    false_acceptance: float
    false_rejection: float
    power: float


def verify(
    load: RigidLoad, nominal: RigidLoad, mass_tolerance: float, centre_tolerance: float, error_rate: float = 0.05
) -> Verification:
    """Is the mass within ``mass_tolerance`` kg and each coordinate of the centre within ``centre_tolerance`` m?

    Two one-sided tests of each quantity at ``error_rate``; acceptance needs all, so its error rate does not grow with
    their number. For rejection the rate is divided among them. Raises InputError for a tolerance that is not positive.
    """
    if not (mass_tolerance > 0.0 and centre_tolerance > 0.0):
        raise InputError("tolerance", "is not positive", "give kg and m")
    deviation = np.abs(np.append(load.centre.value - nominal.centre.value, load.mass.value - nominal.mass.value))
    error = np.sqrt(
        np.append(load.centre.standard_error, load.mass.standard_error) ** 2
        + np.append(nominal.centre.standard_error, nominal.mass.standard_error) ** 2
    )
    tolerance = np.array([centre_tolerance] * 3 + [mass_tolerance])
    inside = deviation + norm.isf(error_rate) * error < tolerance
    # A deviation has two sides to leave the tolerance by.
    outside = deviation - norm.isf(error_rate / (2 * len(tolerance))) * error > tolerance
    with np.errstate(divide="ignore", invalid="ignore"):
        reach = tolerance / error - norm.isf(error_rate)
    missed = np.where(np.isnan(reach), 1.0, np.minimum(1.0, 2.0 * norm.sf(reach)))
    verdict: Literal["accepted", "rejected", "undecided"] = (
        "accepted" if inside.all() else "rejected" if outside.any() else "undecided"
    )
    return Verification(verdict, error_rate, error_rate, float(max(0.0, 1.0 - missed.sum())))


def _invariants(load: RigidLoad) -> Measured:
    """Mass and principal moments (4,) with their joint covariance, the moments NaN where not told."""
    moments = load.principal_moments
    value = np.append(load.mass.value, moments.value)
    covariance = np.zeros((4, 4))
    covariance[0, 0] = load.mass.covariance[0, 0]
    covariance[1:, 1:] = moments.covariance
    return Measured(value, covariance)


def _off(measured: Measured, calibration: float) -> Array:
    return np.asarray(np.diag((calibration * np.where(np.isfinite(measured.value), measured.value, 0.0)) ** 2))


def _p_value(a: Measured, b: Measured) -> float:
    told = np.isfinite(a.value) & np.isfinite(b.value)
    return float(chi2.sf(_distance(a, b, np.zeros((4, 4))) ** 2, int(told.sum())))


def _distance(a: Measured, b: Measured, more: Array) -> float:
    """Mahalanobis distance over what both tell; without any error, equal is zero and different infinite."""
    told = np.flatnonzero(np.isfinite(a.value) & np.isfinite(b.value) & np.isfinite(np.diag(more)))
    difference = (a.value - b.value)[told]
    covariance = (a.covariance + b.covariance + more)[np.ix_(told, told)]
    scale = np.sqrt(np.diag(covariance))
    if np.any(scale == 0.0):
        return 0.0 if np.allclose(difference, 0.0) else float(np.inf)
    return float(
        np.sqrt((difference / scale) @ np.linalg.solve(covariance / np.outer(scale, scale), difference / scale))
    )
