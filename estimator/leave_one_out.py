"""How well each recording is predicted from the others: from sums alone, without a second pass."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.estimation import Estimate
from estimator.normal_equations import residual_autocovariance, torque_power
from estimator.rows import Layout
from estimator.sums import Sums

Array = NDArray[np.float64]

_SINGULAR = 1e10
"""Condition number beyond which the others are said not to determine the unknowns."""


def leave_one_out(layout: Layout, sums: Sums, found: Estimate) -> dict[int, float]:
    """For each recording 100·‖residual‖/‖measured‖ over all joints, percent, with the unknowns of all other recordings.

    Which terms are fitted, and the joints' weights, stay those of all recordings. Empty for a single recording, and
    without those that the others do not determine.
    """
    recordings = sorted({batch.recording for batch in sums.batches})
    result: dict[int, float] = {}
    if len(recordings) < 2:
        return result
    owner = np.array(found.owners)
    for recording in recordings:
        others = owner != recording
        matrix = found.equations.matrix[others].sum(axis=0) + found.equations.prior_matrix
        right = found.equations.right[others].sum(axis=0) + found.equations.prior_right
        scale = np.sqrt(np.abs(np.diag(matrix)))
        if not scale.all() or np.linalg.cond(matrix / np.outer(scale, scale)) > _SINGULAR:
            continue
        unknowns = np.zeros(layout.size)
        unknowns[found.chosen] = np.linalg.solve(matrix / np.outer(scale, scale), right / scale) / scale
        own = [batch for batch in sums.batches if batch.recording == recording]
        left = residual_autocovariance(layout, own, unknowns)[:, 0].sum()
        result[recording] = 100.0 * float(np.sqrt(left / torque_power(layout, own).sum()))
    return result
