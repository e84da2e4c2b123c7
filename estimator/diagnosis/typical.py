"""What data say against a law that is as things of its name usually are, where a plainer one that it contains was
found."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.special import logsumexp

from estimator.diagnosis.conditional import Conditional
from estimator.effects import Law

Array = NDArray[np.float64]
Indices = NDArray[np.intp]


def against_typical(model: Conditional, plain: Law, column: int, wide: Law, shapes: Sequence[Indices]) -> float | None:
    """nats by which they speak against what the ``wide`` law usually has beside the plain one (`Law.typical`), whose
    coefficient is the model's unknown ``column``; None where that is not known, or the plain one not in the model.

    ``shapes``: the columns (c,) of the wide law's candidates, which are as likely as each other. What data are too poor
    to show, they do not speak against.
    """
    typical = wide.typical.get(plain.name)
    place = np.flatnonzero(model.active == column)
    if typical is None or not place.size:
        return None
    (own,) = place
    level, told = float(model.value[own]), 1.0 / float(model.covariance[own, own])
    usual = np.array(typical)
    either = [usual, -usual] if np.min(usual) < 0.0 else [usual]
    against = []
    for columns in shapes:
        matrix, score, _ = model.left_of(columns)
        taken = model.covariance[own] @ model.told.of_active(model.active, columns)
        ways = []
        for way in either:
            # The plain law alone has taken a part of what stands beside it: its level is less beside it.
            whole = 1.0 + float(taken @ way)
            best = (told * whole * level + float(score @ way)) ** 2 / (told * whole**2 + float(way @ matrix @ way))
            ways.append(0.5 * (told * level**2 - best))
        against.append(min(ways))
    return float(np.log(len(against)) - logsumexp(-np.array(against)))
