"""The load and the sensor's offsets, sample by sample during any motion, from prior knowledge on (thesis, 3.3.2)."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.loads.parameters import RigidLoad

Array = NDArray[np.float64]


class RecursiveLoad:
    """Recursive least squares as a Kalman filter on sixteen unknowns: ten parameters, six offsets.

    ``noise`` (6,) N, N·m: standard deviation of one sample, white from one update to the next, so update no faster
    than the sensor's noise is wide. ``drift`` (6,) N/√s, N·m/√s: random walk of the offsets. Raises InputError when
    the noise is not positive or the prior does not know all of its parameters.
    """

    def __init__(
        self,
        prior: RigidLoad,
        noise: Array,
        offset: Array | None = None,
        offset_error: Array | None = None,
        drift: Array | None = None,
    ) -> None:
        self._noise = np.asarray(noise, dtype=float)
        if self._noise.shape != (6,) or not np.all(self._noise > 0.0):
            raise InputError("noise", "is not six positive numbers", "give the sensor's standard deviation a channel")
        if not (np.isfinite(prior.parameters).all() and np.isfinite(prior.covariance).all()):
            raise InputError(prior.name, "does not know all ten parameters", "give wide but finite standard errors")
        self._value = np.concatenate([prior.parameters, np.zeros(6) if offset is None else offset])
        self._covariance = np.zeros((16, 16))
        self._covariance[:10, :10] = prior.covariance
        self._covariance[10:, 10:] = np.diag(np.square(np.zeros(6) if offset_error is None else offset_error))
        self._walk = np.square(np.zeros(6) if drift is None else drift)

    @property
    def load(self) -> RigidLoad:
        """As known now."""
        return RigidLoad(self._value[:10].copy(), self._covariance[:10, :10].copy())

    @property
    def offset(self) -> Array:
        """(6,) N, N·m"""
        return self._value[10:].copy()

    def update(self, regressor: Array, wrench: Array, period: float = 0.0) -> Array:
        """One sample: ``regressor`` (6, 10) and ``wrench`` (6,) filtered alike, ``period`` s after the last one.

        Channels that are NaN are left out. Returns the innovation (6,) over its standard deviation.
        """
        places = range(10, 16)
        self._covariance[places, places] += self._walk * period
        seen = np.flatnonzero(np.isfinite(wrench))
        rows = np.hstack([regressor, np.eye(6)])[seen]
        spread = rows @ self._covariance @ rows.T + np.diag(self._noise[seen] ** 2)
        gain = np.linalg.solve(spread, rows @ self._covariance).T
        innovation = np.asarray(wrench)[seen] - rows @ self._value
        self._value = self._value + gain @ innovation
        # Joseph's form stays symmetric and positive after any number of updates.
        rest = np.eye(16) - gain @ rows
        self._covariance = rest @ self._covariance @ rest.T + (gain * self._noise[seen] ** 2) @ gain.T
        result = np.full(6, np.nan)
        result[seen] = innovation / np.sqrt(np.diag(spread))
        return result
