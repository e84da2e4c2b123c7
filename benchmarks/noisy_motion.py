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
_GRID = 25.0
"""Hz: the bound is computed on this grid. The motion's torques end far below 12 Hz: on finer grids it is the same to
twelve digits."""


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


@dataclass(frozen=True)
class Measured:
    """One recording a seed, and the noise that went into each: (samples, 3) of angle, velocity, torque."""

    recordings: list[Trajectory]
    noise: list[tuple[Array, Array, Array]]


def measured(body: RigidBody, seeds: Sequence[int], rate: float, noise: Noise, random: np.random.Generator) -> Measured:
    """The motion of each seed with fresh noise."""
    found: list[Trajectory] = []
    draws: list[tuple[Array, Array, Array]] = []
    for seed in seeds:
        t = np.arange(round(PERIOD * PERIODS * rate)) / rate
        q, dq, ddq = fourier(t, seed)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + VISCOUS * dq
        of_q, of_dq, of_tau = (noise.draw(random, len(t), rate, x) for x in (noise.angle, noise.velocity, noise.torque))
        found.append(Trajectory(t, q + of_q, tau + of_tau, dq + of_dq, q_desired=q, name=f"motion {seed}"))
        draws.append((of_q, of_dq, of_tau))
    return Measured(found, draws)


class Bound:
    """The Cramér–Rao bound of base parameters and viscous coefficients, and the error of who attains it.

    Who attains it knows the true motion's sensitivities and the noise's spectra and solves the linearised problem. Its
    error in the very noise that an estimator had is what to set that estimator's beside: chance is then common to both.
    """

    def __init__(self, body: RigidBody, seeds: Sequence[int], noise: Noise) -> None:
        base = base_parameters(body)
        t = np.arange(round(PERIOD * PERIODS * _GRID)) / _GRID
        self._noise = noise
        self._gains: list[Array] = []
        self._weighted: list[Array] = []
        information = np.zeros((base.rank + 3, base.rank + 3))
        for seed in seeds:
            q, dq, ddq = fourier(t, seed)
            columns = np.concatenate(
                [base.select(torque_regressor(body, q, dq, ddq)), np.einsum("sj,jk->sjk", dq, np.eye(3))], axis=2
            )
            gains = _sensitivities(body, q, dq, ddq)
            stacked = columns.transpose(1, 0, 2).reshape(3 * len(t), -1)
            weighted = np.linalg.solve(_equation_noise(gains, noise), stacked)
            information += stacked.T @ weighted
            self._gains.append(gains)
            self._weighted.append(weighted)
        self._covariance = np.linalg.inv(information)

    @property
    def standard_error(self) -> Array:
        """(rank + 3,)"""
        return np.asarray(np.sqrt(np.diag(self._covariance)))

    def attained(self, drawn: Sequence[tuple[Array, Array, Array]]) -> Array:
        """(rank + 3,) error of who attains the bound, in this noise of `Measured`."""
        pull = np.zeros(len(self._covariance))
        for gains, weighted, (of_q, of_dq, of_tau) in zip(self._gains, self._weighted, drawn, strict=True):
            count = gains.shape[1]
            omega, angle, velocity, left = _spectra(self._noise, count)
            joined = left[:, None] * (
                _lines(of_q, count) / angle[:, None] - (omega / velocity)[:, None] * _lines(of_dq, count)
            )
            missed = [np.fft.ifft(joined * omega[:, None] ** order, axis=0).real for order in range(3)]
            equation = np.fft.ifft(_lines(of_tau, count), axis=0).real
            equation -= sum(np.einsum("sij,sj->si", gain, x) for gain, x in zip(gains, missed, strict=True))
            pull += weighted.T @ equation.T.reshape(-1)
        return np.asarray(self._covariance @ pull)


def _lines(x: Array, count: int) -> NDArray[np.complex128]:
    """(count, n) transform of x (samples, n) in the band of `_GRID`, as that of ``count`` samples."""
    full = np.fft.fft(x, axis=0) * (count / len(x))
    half = count // 2
    return np.asarray(np.concatenate([full[: count - half], full[len(x) - half :]]))


def _spectra(noise: Noise, count: int) -> tuple[NDArray[np.complex128], Array, Array, Array]:
    """Of each line: jω, densities of angle and velocity, and of what both together leave of the angle."""
    frequency: Array = np.asarray(np.fft.fftfreq(count, 1.0 / _GRID), dtype=np.float64)
    omega = np.asarray(2j * np.pi * frequency, dtype=np.complex128)
    angle, velocity = (noise.density(frequency, x) for x in (noise.angle, noise.velocity))
    return omega, angle, velocity, np.asarray(1.0 / (1.0 / angle + np.abs(omega) ** 2 / velocity))


def _equation_noise(gains: Array, noise: Noise) -> Array:
    """(3·N, 3·N) Σ_τ + T·P·Tᵀ of one periodic stretch, joint after joint."""
    count, rate = gains.shape[1], _GRID
    frequency: Array = np.asarray(np.fft.fftfreq(count, 1.0 / rate), dtype=np.float64)
    omega, _, _, left = _spectra(noise, count)
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


def _circulant(spectrum: NDArray[np.complex128] | Array) -> Array:
    first = np.fft.ifft(spectrum).real
    count = len(first)
    return np.asarray(first[(np.arange(count)[:, None] - np.arange(count)[None, :]) % count])
