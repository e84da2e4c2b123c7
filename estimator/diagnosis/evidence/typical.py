"""What data say against a law that is as things of its name usually are, where a plainer one that it contains was
found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from estimator.diagnosis.evidence.conditional import Conditional
from estimator.effects import Law

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def against_typical(
    model: Conditional, law: Law, columns: Indices, wide: Law, shapes: Sequence[Indices]
) -> float | None:
    """nats by which they speak against what the ``wide`` law usually has beside the plain one (`Law.typical`), which
    the ``law`` that was found is, or contains: bristles beside which a friction may rise from rest as it does beside
    Coulomb's. None where that is not known, or the law not in the model.

    ``columns``: the law's unknowns in the model. ``shapes``: the columns (c,) of the wide law's candidates that have
    them, which are as likely as each other. What data are too poor to show, they do not speak against.
    """
    plain = next((name for name in (law.name, *law.contains) if name in wide.typical), None)
    places = [int(own) for k in law.levels for own in np.flatnonzero(model.active == columns[k])]
    if plain is None or not places or not shapes:
        return None
    typical = wide.typical[plain]
    # Of a friction that drifts the larger level is the one that is known.
    own = max(places, key=lambda k: abs(float(model.value[k])))
    level, told = float(model.value[own]), 1.0 / float(model.covariance[own, own])
    usual = np.array(typical)
    either = [usual, -usual] if np.min(usual) < 0.0 else [usual]
    against = []
    for shape in shapes:
        matrix, score, _ = model.left_of(shape)
        taken = model.covariance[own] @ model.told.of_active(model.active, shape)
        ways = []
        for way in either:
            # The plain law alone has taken a part of what stands beside it: its level is less beside it.
            whole = 1.0 + float(taken @ way)
            best = (told * whole * level + float(score @ way)) ** 2 / (told * whole**2 + float(way @ matrix @ way))
            ways.append(0.5 * (told * level**2 - best))
        against.append(min(ways))
    return float(np.log(len(against)) - logsumexp(-np.array(against)))
