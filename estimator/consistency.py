"""A full set of inertial parameters that bodies can have, near the prior, with the torques that were measured.

Torques fix the base parameters only. Of all parameters with (nearly) those base parameters this finds the ones
nearest the prior in the log-determinant divergence of the pseudo-inertia, a distance that does not depend on units
or frames (Lee, Wensing, Park 2020). The pseudo-inertia must be positive definite, a linear matrix inequality in the
parameters (Wensing, Kim, Slotine 2018), and the divergence is its barrier: the problem is convex and self-concordant,
so damped Newton steps reach the one answer from anywhere.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.base_parameters import BaseParameters
from estimator.identification import LinkIdentification

Array = NDArray[np.float64]

_LEAST_EIGENVALUE = 1e-6
"""Of a prior's pseudo-inertia, relative to its largest: a point mass in the prior becomes a small body."""
_LEAST_FACTOR = 1e-6
"""Of a pseudo-inertia's Cholesky factor, least to largest diagonal."""
_PRIOR_WEIGHT = 1e-3
"""The prior's pull: it counts as much as a misfit of the base parameters of a thirtieth of their standard errors."""
_FIRST_WEIGHT, _PATH_STEPS = 1e5, 17
"""The pull with which the path begins, and how many it passes, each a third of the one before."""

_ROUGHLY = 1e-2
"""Squared Newton decrement that is good enough on the way."""
_NEWTON_STEPS = 200
_DECREMENT = 1e-20
"""Squared Newton decrement, relative to the prior's weight, at which the answer stands to all digits."""


@dataclass(frozen=True)
class ConsistentParameters:
    """A physically possible arm."""

    parameters: Array
    """(10·n,) in the order of `RigidBody.prior`."""
    misfit: Array
    """(rank,) base parameters less the identified ones, in standard errors: large where no body can have them."""


def pseudo_inertia(parameters: Array) -> Array:
    """(4, 4) of one link's ten parameters about its frame: [[Σ, mc], [mcᵀ, m]] with Σ = ½ tr(I)·1 − I.

    A body can have the parameters exactly when it is positive definite.
    """
    m, x, y, z, xx, xy, xz, yy, yz, zz = np.asarray(parameters, dtype=float)
    return np.array(
        [
            [(yy + zz - xx) / 2, -xy, -xz, x],
            [-xy, (xx + zz - yy) / 2, -yz, y],
            [-xz, -yz, (xx + yy - zz) / 2, z],
            [x, y, z, m],
        ]
    )


def parameters_of(pseudo: Array) -> Array:
    """(10,) of a pseudo-inertia: the inverse of `pseudo_inertia`."""
    p = pseudo
    return np.array(
        [
            p[3, 3], p[0, 3], p[1, 3], p[2, 3],
            p[1, 1] + p[2, 2], -p[0, 1], -p[0, 2], p[0, 0] + p[2, 2], -p[1, 2], p[0, 0] + p[1, 1],
        ]
    )  # fmt: skip


_UNITS = np.array([pseudo_inertia(unit) for unit in np.eye(10)])
"""(10, 4, 4): the pseudo-inertia of each unit parameter."""


def is_consistent(parameters: Array) -> NDArray[np.bool_]:
    """(n,) whether a body can have each link's ten parameters (10·n,)."""
    return np.array([np.linalg.eigvalsh(pseudo_inertia(p))[0] > 0.0 for p in np.reshape(parameters, (-1, 10))])


def nearest_consistent(base: BaseParameters, beta: Array, covariance: Array, prior: Array) -> ConsistentParameters:
    """Physically possible parameters (10·n,) near ``prior`` with the base parameters ``beta`` (rank,), as far as
    ``covariance`` (rank, rank) insists on them; rows of NaN were not measured and follow the prior alone.

    Raises InputError when the prior has a link without mass.
    """
    anchors = [_made_definite(pseudo) for pseudo in _with_mass(prior)]
    known = np.isfinite(np.diag(covariance))
    whitener = _whitener(covariance[np.ix_(known, known)])
    combination, target = whitener @ base.combination[known], whitener @ beta[known]
    divergence = _Divergence([np.asarray(np.linalg.inv(anchor), dtype=float) for anchor in anchors])
    psi = np.concatenate([parameters_of(anchor) for anchor in anchors])

    # Along the central path, from the prior towards the data: every answer on the way is well inside the possible
    # bodies, where Newton's steps are sure, also when no body can have the measured parameters.
    for weight in np.geomspace(_FIRST_WEIGHT, _PRIOR_WEIGHT, _PATH_STEPS):
        psi = _newton(combination, target, divergence, float(weight), _ROUGHLY, psi)
    psi = _newton(combination, target, divergence, _PRIOR_WEIGHT, _DECREMENT, psi)
    misfit = np.zeros(base.rank)
    misfit[known] = (base.combination[known] @ psi - beta[known]) / np.sqrt(np.diag(covariance)[known])
    return ConsistentParameters(psi, misfit)


def _newton(
    combination: Array, target: Array, divergence: _Divergence, weight: float, decrement: float, psi: Array
) -> Array:
    """The minimum of ½‖combination·psi − target‖² + weight·divergence(psi), by damped steps from ``psi``; ends when the
    squared Newton decrement, relative to the weight, is below ``decrement``."""

    def cost(trial: Array) -> float:
        error = combination @ trial - target
        return 0.5 * float(error @ error) + weight * divergence.value(trial)

    for _ in range(_NEWTON_STEPS):
        slope, curvature = divergence.derivatives(psi)
        gradient = combination.T @ (combination @ psi - target) + weight * slope
        hessian = combination.T @ combination + weight * curvature
        scale = np.sqrt(np.diag(hessian))
        # At the very edge of the possible bodies the curvature is beyond what double precision solves: the
        # least-squares step still descends.
        step = -np.linalg.lstsq(hessian / np.outer(scale, scale), gradient / scale, rcond=None)[0] / scale
        decrease = -float(gradient @ step)
        if decrease < decrement * weight:
            break
        length, now = 1.0, cost(psi)
        while length > 1e-12 and not cost(psi + length * step) <= now - 1e-4 * length * decrease:
            length /= 2.0
        if length <= 1e-12:
            break  # no descent left within rounding
        psi = psi + length * step
    return psi


class _Divergence:
    """Σ over links of tr(P₀⁻¹P) − log det P: least at the prior, infinite where no body can be."""

    def __init__(self, inverses: list[Array]) -> None:
        self.inverses = inverses

    def value(self, psi: Array) -> float:
        total = 0.0
        for link, inverse in zip(psi.reshape(-1, 10), self.inverses, strict=True):
            pseudo = pseudo_inertia(link)
            try:
                factor = np.linalg.cholesky(pseudo)
            except np.linalg.LinAlgError:
                return float("inf")
            # So close to the edge of the possible bodies the inverse is lost in rounding.
            if np.diag(factor).min() < _LEAST_FACTOR * np.diag(factor).max():
                return float("inf")
            total += float(np.sum(inverse * pseudo)) - 2.0 * float(np.log(np.diag(factor)).sum())
        return total

    def derivatives(self, psi: Array) -> tuple[Array, Array]:
        """Gradient (10·n,) and Hessian (10·n, 10·n)."""
        gradient, hessian = np.empty(len(psi)), np.zeros((len(psi), len(psi)))
        for k, inverse in enumerate(self.inverses):
            span = slice(10 * k, 10 * k + 10)
            own = np.linalg.inv(pseudo_inertia(psi[span]))
            gradient[span] = np.einsum("kab,ab->k", _UNITS, inverse - own)
            spread = own @ _UNITS
            hessian[span, span] = np.einsum("iab,jba->ij", spread, spread)
        return gradient, hessian


def prior_precision(prior: Array, tolerance: float) -> Array:
    """Inverse covariance (10·n, 10·n) of parameters that are believed to be ``prior`` within a relative ``tolerance``.

    The divergence's curvature at the prior: the same belief in any unit or frame. A mass alone has the standard
    deviation tolerance·m, a centre of mass that fraction of the body's radius of gyration.
    Raises InputError when a link has no mass.
    """
    anchors = [_made_definite(pseudo) for pseudo in _with_mass(prior)]
    divergence = _Divergence([np.asarray(np.linalg.inv(anchor), dtype=float) for anchor in anchors])
    _, curvature = divergence.derivatives(np.concatenate([parameters_of(anchor) for anchor in anchors]))
    return curvature / tolerance**2


def _with_mass(prior: Array) -> list[Array]:
    links = np.reshape(prior, (-1, 10))
    for number, link in enumerate(links, 1):
        if not link[0] > 0.0:
            raise InputError("URDF", f"link {number} has no mass", "give every moving link an inertial element")
    return [pseudo_inertia(link) for link in links]


def consistent_parameters(found: LinkIdentification, prior: Array | None = None) -> ConsistentParameters:
    """Of an identification, near its URDF's own inertias unless another prior (10·n,) is given.

    Raises InputError when the identification has no standard errors to weigh against the prior.
    """
    if not found.degrees_of_freedom.any():
        raise InputError("recordings", "are too short for standard errors", "record longer, or several motions")
    rank = found.base.rank
    anchor = found.body.prior() if prior is None else prior
    return nearest_consistent(found.base, found.beta, found.covariance[:rank, :rank], anchor)


def _made_definite(pseudo: Array) -> Array:
    values, vectors = np.linalg.eigh(pseudo)
    return np.asarray((vectors * np.maximum(values, _LEAST_EIGENVALUE * values[-1])) @ vectors.T)


def _whitener(covariance: Array) -> Array:
    """W with WᵀW the inverse covariance; small eigenvalues are held at the size of their diagonal's rounding."""
    scale = np.sqrt(np.diag(covariance))
    values, vectors = np.linalg.eigh(covariance / np.outer(scale, scale))
    return np.asarray((vectors / np.sqrt(np.maximum(values, 1e-3))).T / scale)
