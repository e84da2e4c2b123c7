"""Bodies about another point than their centre (Huygens' and Steiner's theorem).

Six entries of an inertia are in the order xx xy xz yy yz zz, as in a link's ten parameters.
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

Array = NDArray[np.float64]

_UPPER = np.triu_indices(3)


def unit_mass_at(centre: Array) -> Array:
    """(6,) m², inertia about the origin of a unit mass at ``centre`` (3,) m: |c|²·1 − c·cᵀ."""
    return np.asarray((centre @ centre * np.eye(3) - np.outer(centre, centre))[_UPPER])


def unit_mass_slopes(centre: Array) -> Array:
    """(6, 3) m, by how much that changes as the mass moves along each axis."""
    slopes = [
        2.0 * x * np.eye(3) - np.outer(e, centre) - np.outer(centre, e) for x, e in zip(centre, np.eye(3), strict=True)
    ]
    return np.stack([slope[_UPPER] for slope in slopes], axis=1)


def about_centre(parameters: Array) -> Array:
    """(6,) kg·m², inertia about the centre of the body with these ten parameters (mass, first moments, inertia about
    the frame's origin). Its mass must not be zero."""
    mass = parameters[0]
    return np.asarray(parameters[4:] - mass * unit_mass_at(parameters[1:4] / mass))
