"""What a motion would tell of base parameters, friction and offsets: the information matrix, and its log-determinant's
slope along the motion."""

from __future__ import annotations

from dataclasses import dataclass, field

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import BaseParameters
from estimator.excitation.slopes import slopes
from estimator.regressor import torque_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_BESIDE = 3
"""Nuisances of each joint: viscous friction, Coulomb friction, offset."""
_WIDTH = 0.05
"""rad/s: Coulomb friction's sigmoid, wide enough for its slope to guide."""


@dataclass(frozen=True)
class Information:
    """Of measured torques with white noise ``noise`` (n,), rms a sample, at ``rate`` Hz.

    ``known`` (rank, rank): information about the base parameters that is there already, the inverse of their
    covariance; what is uncertain then counts, what is known does not. Without it, a vague belief in the order of
    ``scale`` (rank,) keeps the determinant finite.
    """

    body: RigidBody
    base: BaseParameters
    noise: Array
    rate: float
    known: Array | None = None
    scale: Array | None = None
    _prior: Array = field(init=False, repr=False)

    def __post_init__(self) -> None:
        size = self.base.rank + _BESIDE * self.body.n
        prior = np.zeros((size, size))
        vague = np.ones(self.base.rank) if self.scale is None else np.asarray(self.scale, dtype=float)
        prior[: self.base.rank, : self.base.rank] = np.diag(1.0 / vague**2) if self.known is None else self.known
        beside = np.repeat(1.0 / (1e3 * self.noise) ** 2, _BESIDE)
        prior[self.base.rank :, self.base.rank :] = np.diag(beside)
        object.__setattr__(self, "_prior", prior)

    def rows(self, q: Array, dq: Array, ddq: Array) -> Array:
        """(samples, n, size): the regressor of base parameters and nuisances, in units of the noise."""
        n, rank = self.body.n, self.base.rank
        result = np.zeros((len(q), n, rank + _BESIDE * n))
        result[:, :, :rank] = self.base.select(torque_regressor(self.body, q, dq, ddq))
        for joint in range(n):
            own = rank + _BESIDE * joint
            result[:, joint, own] = dq[:, joint]
            result[:, joint, own + 1] = np.tanh(dq[:, joint] / _WIDTH)
            result[:, joint, own + 2] = 1.0
        return np.asarray(result / self.noise[:, None])

    def matrix(self, q: Array, dq: Array, ddq: Array, seconds: float) -> Array:
        """(size, size) of the motion lasting ``seconds``, however many samples describe it."""
        rows = self.rows(q, dq, ddq).reshape(-1, len(self._prior))
        return np.asarray(self._prior + (seconds * self.rate / len(q)) * rows.T @ rows)

    def standard_errors(self, q: Array, dq: Array, ddq: Array, seconds: float) -> Array:
        """(rank,) of the base parameters, nuisances fitted with them."""
        matrix = self.matrix(q, dq, ddq, seconds)
        scale = np.sqrt(np.diag(matrix))
        inverse = np.linalg.inv(matrix / np.outer(scale, scale)) / np.outer(scale, scale)
        return np.asarray(np.sqrt(np.diag(inverse)[: self.base.rank]))

    def log_determinant(self, q: Array, dq: Array, ddq: Array, seconds: float) -> tuple[float, tuple[Array, ...]]:
        """log det of the matrix, and its exact derivatives (samples, n) with respect to q, dq and ddq."""
        rows = self.rows(q, dq, ddq)
        flat = rows.reshape(-1, len(self._prior))
        weight = seconds * self.rate / len(q)
        matrix = self._prior + weight * flat.T @ flat
        scale = np.sqrt(np.diag(matrix))
        scaled = matrix / np.outer(scale, scale)
        value = float(np.linalg.slogdet(scaled)[1] + 2.0 * np.log(scale).sum())
        # d log det M = tr(M⁻¹ dM) = 2·weight·Σ (row·M⁻¹)·d row: torques of fixed parameters, one set a row.
        fixed = 2.0 * weight * (np.linalg.solve(scaled, (flat / scale).T).T / scale).reshape(rows.shape)
        rank = self.base.rank
        weights = np.zeros((len(q), self.body.n, 10 * self.body.n))
        weights[:, :, list(self.base.kept)] = fixed[:, :, :rank] * self.base.sign / self.noise[:, None]
        by_q, by_dq, by_ddq = slopes(self.body, weights, q, dq, ddq)
        for joint in range(self.body.n):
            own = rank + _BESIDE * joint
            sharp = (1.0 - np.tanh(dq[:, joint] / _WIDTH) ** 2) / _WIDTH
            by_dq[:, joint] += (fixed[:, joint, own] + fixed[:, joint, own + 1] * sharp) / self.noise[joint]
        return value, (by_q, by_dq, by_ddq)
