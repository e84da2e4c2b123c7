"""A rigid load as ten parameters with their covariance, and what follows from them (thesis, Eq. 3.16 to 3.18)."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.parallel_axis import unit_mass_at

Array = NDArray[np.float64]

INERTIA = ("xx", "xy", "xz", "yy", "yz", "zz")
_ROWS, _COLUMNS = np.array([0, 0, 0, 1, 1, 2]), np.array([0, 1, 2, 1, 2, 2])


@dataclass(frozen=True)
class Measured:
    """A quantity with the covariance of its entries, flattened."""

    value: Array
    covariance: Array

    @property
    def standard_error(self) -> Array:
        """In the shape of the value; infinite for what the data do not tell."""
        return np.asarray(np.sqrt(np.diag(self.covariance)).reshape(np.shape(self.value)))


@dataclass(frozen=True)
class PrincipalAxes:
    """``value`` (3, 3): rows are the axes of the principal moments in turn, in the sensor's frame, right-handed.

    ``standard_error`` (3,) rad: how far each axis may be turned away; ``told`` (3,): whether it means anything.
    """

    value: Array
    standard_error: Array
    told: NDArray[np.bool_]


@dataclass(frozen=True)
class RigidLoad:
    """``parameters`` (10,): m, mc (3), Ixx Ixy Ixz Iyy Iyz Izz about the sensor's origin; ``covariance`` (10, 10).

    NaN parameters are not known; their variance is infinite. Raises InputError for shapes that disagree.
    """

    parameters: Array
    covariance: Array = field(default_factory=lambda: np.zeros((10, 10)))
    name: str = "load"

    def __post_init__(self) -> None:
        if np.shape(self.parameters) != (10,) or np.shape(self.covariance) != (10, 10):
            raise InputError(
                self.name,
                f"has parameters {np.shape(self.parameters)} and covariance {np.shape(self.covariance)}",
                "give (10,) and (10, 10)",
            )

    @property
    def mass(self) -> Measured:
        """kg"""
        return self._derived(np.asarray(self.parameters[0]), np.eye(10)[:1])

    @property
    def centre(self) -> Measured:
        """(3,) m: centre of mass in the sensor's frame (Eq. 3.16)."""
        m, mc = self._mass_to_divide_by, self.parameters[1:4]
        jacobian = np.zeros((3, 10))
        jacobian[:, 0] = -mc / m**2
        jacobian[:, 1:4] = np.eye(3) / m
        return self._derived(mc / m, jacobian)

    @property
    def inertia(self) -> Measured:
        """(6,) kg·m²: xx xy xz yy yz zz about the centre of mass, in the sensor's axes (Eq. 3.17)."""
        m, mc = self._mass_to_divide_by, self.parameters[1:4]
        shifted = (mc @ mc) * np.eye(3) - np.outer(mc, mc)
        jacobian = np.zeros((6, 10))
        jacobian[:, 0] = (shifted / m**2)[_ROWS, _COLUMNS]
        for k in range(3):
            unit = np.eye(3)[k]
            slope = 2.0 * mc[k] * np.eye(3) - np.outer(unit, mc) - np.outer(mc, unit)
            jacobian[:, 1 + k] = -(slope / m)[_ROWS, _COLUMNS]
        jacobian[:, 4:] = np.eye(6)
        return self._derived(self.parameters[4:] - (shifted / m)[_ROWS, _COLUMNS], jacobian)

    @property
    def principal_moments(self) -> Measured:
        """(3,) kg·m², the largest first (Eq. 3.18). Equal ones within their errors are pushed apart by the ordering."""
        inertia = self.inertia
        if not np.isfinite(inertia.value).all():
            return Measured(np.full(3, np.nan), np.diag(np.full(3, np.inf)))
        moments, axes = _diagonalised(inertia.value)
        jacobian = np.array([_entries(axis, axis) for axis in axes])
        return Measured(moments, jacobian @ inertia.covariance @ jacobian.T)

    @property
    def principal_axes(self) -> PrincipalAxes:
        """Axes of the `principal_moments`. Told when they turn by less than 20° (one standard error)."""
        inertia = self.inertia
        if not np.isfinite(inertia.value).all():
            return PrincipalAxes(np.full((3, 3), np.nan), np.full(3, np.inf), np.zeros(3, dtype=np.bool_))
        moments, axes = _diagonalised(inertia.value)
        variance = np.zeros(3)
        for i in range(3):
            for j in set(range(3)) - {i}:
                turn = _entries(axes[i], axes[j])
                # Eq. 3.24, 3.25: what turns axis i towards j is divided by the difference of their moments.
                gap = float(abs(moments[i] - moments[j]))
                variance[i] += turn @ inertia.covariance @ turn / gap**2 if gap > 1e-12 * moments[0] else np.inf
        error = np.minimum(np.sqrt(variance), np.pi / 2)
        return PrincipalAxes(axes, error, np.asarray(error < np.radians(20.0)))

    def without(self, hand: RigidLoad) -> RigidLoad:
        """What is left when the hand is taken away; both about the same origin, errors independent."""
        return RigidLoad(self.parameters - hand.parameters, self.covariance + hand.covariance, self.name)

    @property
    def _mass_to_divide_by(self) -> float:
        """NaN for none: nothing has no centre."""
        return float(self.parameters[0]) or float("nan")

    def _derived(self, value: Array, jacobian: Array) -> Measured:
        """Delta method; what depends on an unknown parameter is unknown."""
        unknown = ~np.isfinite(self.parameters)
        lost = (jacobian[:, unknown] != 0.0).any(axis=1) | ~np.isfinite(np.atleast_1d(value))
        known = ~unknown
        covariance = jacobian[:, known] @ self.covariance[np.ix_(known, known)] @ jacobian[:, known].T
        covariance[lost], covariance[:, lost] = np.nan, np.nan
        covariance[lost, lost] = np.inf
        return Measured(np.where(lost.reshape(np.shape(value)), np.nan, value), covariance)


def rigid_load(
    mass: float, centre: Array, inertia: Array, covariance: Array | None = None, name: str = "load"
) -> RigidLoad:
    """Of mass kg, centre (3,) m and inertia (6,) xx xy xz yy yz zz kg·m² about the centre; the inverse of Eq. 3.17."""
    centre = np.asarray(centre, dtype=float)
    about_origin = np.asarray(inertia, dtype=float) + mass * unit_mass_at(centre)
    parameters = np.concatenate([[mass], mass * centre, about_origin])
    return RigidLoad(parameters, np.zeros((10, 10)) if covariance is None else covariance, name)


def _diagonalised(inertia: Array) -> tuple[Array, Array]:
    """Principal moments, the largest first, and their axes as the rows of a rotation."""
    matrix = np.empty((3, 3))
    matrix[_ROWS, _COLUMNS] = matrix[_COLUMNS, _ROWS] = inertia
    moments, vectors = np.linalg.eigh(matrix)
    axes = vectors.T[::-1].copy()
    # Each axis points the way of its largest component; the last completes a right-handed frame.
    for k in range(2):
        axes[k] *= np.sign(axes[k, np.argmax(np.abs(axes[k]))])
    axes[2] = np.cross(axes[0], axes[1])
    return moments[::-1].copy(), axes


def _entries(a: Array, b: Array) -> Array:
    """(6,): aᵀ·dI·b as a row on the six entries of dI."""
    both = np.outer(a, b) + np.outer(b, a)
    return np.asarray(np.where(_ROWS == _COLUMNS, 0.5, 1.0) * both[_ROWS, _COLUMNS])
