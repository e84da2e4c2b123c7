"""A known arm in a known motion, measured with known noise in every channel; and the least error that allows.

The Cramér–Rao bound counts the true motion among the unknowns: torque τ = f(x, θ) + n_τ, angle x + n_q, velocity
ẋ + n_v. What angle and velocity together leave of x has the spectrum P = 1/(1/S_q + ω²/S_v); carried through the
linearised dynamics T it adds to the torque's noise, and the bound is (Kᵀ(Σ_τ + T·P·Tᵀ)⁻¹K)⁻¹.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, base_parameters, inverse_dynamics, torque_regressor

Array = NDArray[np.float64]

VISCOUS = np.array([1.5, 0.6, 0.4])
"""N·m·s/rad, identified with the base parameters."""
PERIOD = 5.0
"""s, of the Fourier motion; a recording is two periods."""
PERIODS = 2
_GRID = 100.0
"""Hz: the bound is computed on this grid. The motion's torques end far below 50 Hz, so nothing is lost."""


@dataclass(frozen=True)
class Noise:
    """Standard deviations of one sample, white or first-order coloured (``corner`` Hz) with the same density at rest
    for every sampling rate: densities are those of white noise of these deviations at 250 Hz."""

    torque: Array
    angle: float
    velocity: float
    corner: float | None = None

    def density(self, frequency: Array, deviation: Array | float) -> Array:
        """Two-sided power density, unit²/Hz."""
        flat = np.asarray(deviation) ** 2 / 250.0 * np.ones_like(frequency)
        return flat if self.corner is None else np.asarray(flat / (1.0 + (frequency / self.corner) ** 2))

    def draw(self, random: np.random.Generator, samples: int, rate: float, deviation: Array | float) -> Array:
        """(samples, 3) N(0, density) in the band of this rate."""
        frequency: Array = np.asarray(np.fft.rfftfreq(samples, 1.0 / rate), dtype=np.float64)
        white = np.fft.rfft(random.normal(size=(samples, 3)), axis=0)
        shape = np.sqrt(self.density(frequency, 1.0) * rate)[:, None]
        return np.asarray(np.fft.irfft(white * shape, samples, axis=0) * deviation)


def fourier(t: Array, seed: int, joints: int = 3) -> tuple[Array, Array, Array]:
    """Angles, velocities, accelerations of five harmonics of 1/`PERIOD`, at any times."""
    random = np.random.default_rng(seed)
    q, dq, ddq = np.full((len(t), joints), 2.0), np.zeros((len(t), joints)), np.zeros((len(t), joints))
    for harmonic in range(1, 6):
        w = 2 * np.pi * harmonic / PERIOD
        a, b = random.normal(0.0, 0.35, (2, joints))
        s, c = np.sin(w * t)[:, None], np.cos(w * t)[:, None]
        q += a * s + b * c
        dq += w * (a * c - b * s)
        ddq -= w**2 * (a * s + b * c)
    return q, dq, ddq


def recordings(
    body: RigidBody, seeds: Sequence[int], rate: float, noise: Noise, random: np.random.Generator
) -> list[Trajectory]:
    """One recording a seed of the motion, with fresh noise."""
    result = []
    for seed in seeds:
        t = np.arange(round(PERIOD * PERIODS * rate)) / rate
        q, dq, ddq = fourier(t, seed)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + VISCOUS * dq
        drawn = [noise.draw(random, len(t), rate, x) for x in (noise.angle, noise.velocity, noise.torque)]
        result.append(Trajectory(t, q + drawn[0], tau + drawn[2], dq + drawn[1], q_desired=q, name=f"motion {seed}"))
    return result


def bound(body: RigidBody, seeds: Sequence[int], rate: float, noise: Noise) -> Array:
    """(rank + 3,) least standard errors of base parameters and viscous coefficients; ``rate`` Hz limits the bands."""
    base = base_parameters(body)
    information = np.zeros((base.rank + 3, base.rank + 3))
    grid = min(_GRID, rate)
    t = np.arange(round(PERIOD * PERIODS * grid)) / grid
    count = len(t)
    for seed in seeds:
        q, dq, ddq = fourier(t, seed)
        columns = np.concatenate(
            [base.select(torque_regressor(body, q, dq, ddq)), np.einsum("sj,jk->sjk", dq, np.eye(3))], axis=2
        )
        covariance = _equation_noise(body, q, dq, ddq, grid, noise)
        stacked = columns.transpose(1, 0, 2).reshape(3 * count, -1)
        information += stacked.T @ np.linalg.solve(covariance, stacked)
    return np.sqrt(np.diag(np.linalg.inv(information)))


def _equation_noise(body: RigidBody, q: Array, dq: Array, ddq: Array, rate: float, noise: Noise) -> Array:
    """(3·N, 3·N) Σ_τ + T·P·Tᵀ of one periodic stretch, joint after joint."""
    count = len(q)
    frequency: Array = np.asarray(np.fft.fftfreq(count, 1.0 / rate), dtype=np.float64)
    omega = 2j * np.pi * frequency
    angle, velocity = (noise.density(frequency, x) for x in (noise.angle, noise.velocity))
    left = 1.0 / (1.0 / angle + np.abs(omega) ** 2 / velocity)
    gains = _sensitivities(body, q, dq, ddq)
    covariance = np.zeros((3, count, 3, count))
    for joint in range(3):
        own = noise.density(frequency, float(noise.torque[joint]))
        covariance[joint, :, joint] += _circulant(own * rate)
        for a in range(3):
            for b in range(3):
                coupling = _circulant(left * rate * omega**a * np.conj(omega**b))
                for i in range(3):
                    for k in range(3):
                        covariance[i, :, k] += gains[a, :, i, joint, None] * coupling * gains[b, None, :, k, joint]
    return covariance.reshape(3 * count, 3 * count)


def _sensitivities(body: RigidBody, q: Array, dq: Array, ddq: Array) -> Array:
    """(3, N, n, n): of the torques to each joint's angle, velocity, acceleration."""
    result = np.empty((3, len(q), 3, 3))
    step = 1e-5
    for joint in range(3):
        for order in range(3):
            shift = np.zeros((3, 1, 3))
            shift[order, 0, joint] = step
            ahead, behind = (
                inverse_dynamics(body, body.prior(), q + s * shift[0], dq + s * shift[1], ddq + s * shift[2])
                for s in (1.0, -1.0)
            )
            result[order, :, :, joint] = (ahead - behind) / (2.0 * step)
        result[1, :, joint, joint] += VISCOUS[joint]
    return result


def _circulant(spectrum: Array) -> Array:
    first = np.fft.ifft(spectrum).real
    count = len(first)
    return np.asarray(first[(np.arange(count)[:, None] - np.arange(count)[None, :]) % count])
