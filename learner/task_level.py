"""Task level learning (Section 7.2): a few parameters of a plan are corrected by how the task came out.

Hitting a point with the tool at a time needs no trajectory to be followed exactly: three numbers say how far it was
missed, and three numbers of the plan (where to aim) mend it. The model says which way; experience amends the model.
"""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
from numpy.typing import NDArray

from config import InputError

Array = NDArray[np.float64]
STEP = 1e-4


class TaskLearner:
    """Finds parameters p with outcome(p) = wanted by trials.

    ``predict``: the model's outcome (m,) of parameters (p,). ``scatter``: standard deviation of an outcome when
    parameters are repeated: misses below twice that are chance and teach nothing; corrections beyond ``reach`` (p,)
    a trial are shortened to it.
    """

    def __init__(
        self, predict: Callable[[Array], Array], start: Array, wanted: Array, scatter: Array, reach: Array
    ) -> None:
        self.parameters = np.asarray(start, dtype=float)
        self._wanted, self._scatter, self._reach = wanted, scatter, reach
        first = predict(self.parameters)
        if first.shape != wanted.shape:
            raise InputError("task", f"has {len(wanted)} wanted outcomes and predicts {len(first)}", "let them agree")
        self._slope = np.column_stack(
            [(predict(self.parameters + STEP * unit) - first) / STEP for unit in np.eye(len(self.parameters))]
        )
        self._before: tuple[Array, Array] | None = None

    def take(self, outcome: Array) -> bool:
        """Learn from what came of the present parameters; True when the miss cannot be told from chance."""
        miss = outcome - self._wanted
        if bool((np.abs(miss) <= 2.0 * self._scatter).all()):
            return True
        if self._before is not None:
            self._amend(outcome)
        self._before = self.parameters.copy(), outcome.copy()
        step = -np.linalg.pinv(self._slope) @ miss
        self.parameters = self.parameters + step / max(1.0, float(np.max(np.abs(step) / self._reach)))
        return False

    def _amend(self, outcome: Array) -> None:
        """Broyden's update of the slope, by the share of the change that is not chance."""
        assert self._before is not None
        moved, seen = self.parameters - self._before[0], outcome - self._before[1]
        surprise = seen - self._slope @ moved
        chance = 2.0 * float(np.sum(self._scatter**2))
        share = float(surprise @ surprise) / (float(surprise @ surprise) + chance)
        self._slope = self._slope + share * np.outer(surprise, moved) / float(moved @ moved)
