"""Prior loads (thesis, 3.3.2): is what is being weighed one of the loads that are known, and what is it then?

Recursive least squares is linear: to begin from a prior, or to weigh with nothing known and combine with the prior
afterwards, is the same. So nothing has to be believed before the samples have spoken: the prior is combined with them
only where they cannot refuse it and refuse everything else, an empty wrist among that.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from estimator.loads.parameters import RigidLoad
from estimator.loads.recognition import CALIBRATION

Array = NDArray[np.float64]

REFUSED = 0.01
"""Chance of refusing the load that it is."""
_TOLD = 0.1
"""Share of its mass to which a load must have been weighed before it is believed to be a known one."""


class KnownLoads:
    """Loads that may be on the wrist. Parameters that one of them does not know (NaN) are left to the samples."""

    def __init__(self, loads: Sequence[RigidLoad]) -> None:
        self._known = [_believed(load) for load in loads]

    def as_prior_of(self, weighed: RigidLoad) -> RigidLoad | None:
        """The known load that ``weighed`` is, of its name, its knowledge and that of the samples combined.

        None while several could be it, or nothing on the wrist; and where it is none of them.
        """
        if not self._known:
            return None
        possible = [load for load in (_NOTHING, *self._known) if _p_value(weighed, load) >= REFUSED]
        if len(possible) != 1 or possible[0] is _NOTHING:
            return None
        (known,) = possible
        if weighed.mass.standard_error > _TOLD * known.parameters[0]:
            return None
        # What both tell, each by its own precision.
        told = np.flatnonzero(np.isfinite(known.parameters))
        gain = np.linalg.solve(_spread(weighed, known, told), weighed.covariance[told]).T
        value = weighed.parameters + gain @ (known.parameters - weighed.parameters)[told]
        covariance = weighed.covariance - gain @ weighed.covariance[told]
        return RigidLoad(value, (covariance + covariance.T) / 2.0, known.name)


def _believed(load: RigidLoad) -> RigidLoad:
    """With what calibration and grip may change: its share of each parameter, and of the centre's distance."""
    about = np.where(np.isfinite(load.parameters), load.parameters, 0.0)
    size = np.abs(about)
    size[1:4] = np.linalg.norm(about[1:4])
    size[4:] = np.max(size[4:])
    return RigidLoad(load.parameters, load.covariance + np.diag((CALIBRATION * size) ** 2), load.name)


_NOTHING = RigidLoad(np.zeros(10), np.zeros((10, 10)), "nothing")


def _spread(weighed: RigidLoad, known: RigidLoad, told: NDArray[np.intp]) -> Array:
    return np.asarray((weighed.covariance + known.covariance)[np.ix_(told, told)])


def _p_value(weighed: RigidLoad, known: RigidLoad) -> float:
    """Chance that the known load is weighed as far from itself as this."""
    told = np.flatnonzero(np.isfinite(known.parameters))
    spread = _spread(weighed, known, told)
    scale = np.sqrt(np.diag(spread))
    difference = (weighed.parameters - known.parameters)[told] / scale
    distance = float(difference @ np.linalg.solve(spread / np.outer(scale, scale), difference))
    return float(chi2.sf(distance, len(told)))
