"""From the true wrench to the sensor's numbers: gauges, mounting, filters, sampling, noise.

true wrench → calibration and mounting errors, bias, drift → analogue low-pass → sampled → noise → digital low-pass
"""

from __future__ import annotations

import math
from collections import deque
from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np

from virtual_hw.hidden.noise import noise_rows
from virtual_hw.hidden.wrench_sensor import WrenchErrors

STREAMS = 1000
"""More than there are sensors: distance of the noise streams of one sensor's starts."""


@dataclass(frozen=True)
class FilterProfile:
    """A sensor's own electronics. ``oversampling``: internal samples an output sample."""

    analogue_hz: float | None
    digital_hz: float | None
    oversampling: int
    order: int = 2


PROFILES = {
    "none": FilterProfile(None, None, 1),
    # Barry Wright Astek FS6-120A-200: 480 Hz inside, 120 Hz analogue and 120 Hz digital low-pass, 240 Hz out.
    "astek": FilterProfile(120.0, 120.0, 2),
    # RTI FS-B: its filters are not documented; a 100 Hz analogue low-pass before the sampling is assumed.
    "rti": FilterProfile(100.0, None, 1),
}


class LowPass:
    """Six channels through one Butterworth low-pass, a sample at a time (bilinear transform)."""

    def __init__(self, corner_hz: float, rate_hz: float, order: int) -> None:
        a, b, c, d = _butterworth(order, min(corner_hz, 0.45 * rate_hz) / rate_hz)
        six = np.eye(6)
        self._states = 6 * order
        self._matrix = np.block([[np.kron(a, six), np.kron(b, six)], [np.kron(c, six), np.kron(d, six)]])
        self._settled = np.kron(np.linalg.solve(np.eye(order) - a, b), six)
        self._w = np.zeros(self._states + 6)
        self._fresh = True

    def step(self, u: list[float]) -> list[float]:
        """The filtered sample; the first input is taken as having been there for ever."""
        w, n = self._w, self._states
        w[n:] = u
        if self._fresh:
            w[:n] = self._settled @ w[n:]
            self._fresh = False
        out = self._matrix @ w
        w[:n] = out[:n]
        filtered: list[float] = out[n:].tolist()
        return filtered


class Transducer:
    """Samples of the sensor at its output rate, from the plant's wrench at every step.

    Without a filter profile each output sample is the mean over its period, as a sinc converter gives.
    """

    def __init__(
        self,
        tap: deque[tuple[int, list[float]]],
        errors: WrenchErrors,
        profile: FilterProfile,
        seed: int,
        stream: int,
        step_s: float,
    ) -> None:
        self._tap, self._errors, self._profile = tap, errors, profile
        self._seed, self._stream, self._step_s = seed, stream, step_s
        turn = np.kron(np.eye(2), _rotation(np.array(errors.rotation_rad)).T)
        self._gain = (np.array(errors.matrix) if errors.matrix is not None else np.eye(6)) @ turn
        self._bias, self._drift = tuple(errors.bias), tuple(errors.drift_per_s)
        self._delay_ns = round(errors.delay_s * 1e9)
        self._analogue = (
            LowPass(profile.analogue_hz, 1.0 / step_s, profile.order) if profile.analogue_hz is not None else None
        )
        self._before: tuple[int, list[float]] | None = None
        self._integral = [0.0] * 6
        self._at_last_sample = [0.0] * 6
        self._sampled = 0
        self._first_ns = 0
        self._due_ns = 0
        self._starts = 0

    def start(self, rate_hz: float, now_ns: int) -> None:
        """Samples at ``rate_hz`` from one period after ``now_ns`` on."""
        internal = rate_hz * self._profile.oversampling
        self._period_ns = 1e9 / internal
        self._digital = (
            LowPass(self._profile.digital_hz, internal, self._profile.order)
            if self._profile.digital_hz is not None
            else None
        )
        channels = [self._errors.force_noise] * 3 + [self._errors.torque_noise] * 3
        # Every start draws on: noise never repeats, whatever the host does with the sensor.
        self._starts += 1
        stream = self._stream + STREAMS * self._starts
        self._noise: Iterator[list[float]] = noise_rows(channels, 1.0 / internal, self._seed, stream)
        self._first_ns, self._sampled = now_ns, 0
        self._at_last_sample = self._integral
        self._schedule()

    def _schedule(self) -> None:
        self._due_ns = self._first_ns + round((self._sampled + 1) * self._period_ns)

    def samples(self, now_ns: int) -> list[tuple[int, list[float]]]:
        """Output samples that fell due by ``now_ns``: (instant in ns, six numbers in N and N·m), oldest first."""
        due: list[tuple[int, list[float]]] = []
        tap, analogue = self._tap, self._analogue
        while tap:
            stamp, true = tap.popleft()
            self._take(stamp + self._delay_ns, true if analogue is None else analogue.step(true), due)
        return due

    def _take(self, stamp: int, value: list[float], due: list[tuple[int, list[float]]]) -> None:
        """One step of the delayed signal: every internal sample between the last step and this one."""
        if self._before is None:
            self._before = (stamp, value)
            self._first_ns = max(self._first_ns, stamp)
            self._schedule()
            return
        begin, old = self._before
        span = stamp - begin
        averaging = self._analogue is None
        while (instant := self._due_ns) <= stamp:
            share = max(0.0, (instant - begin) / span)
            here = [a + share * (b - a) for a, b in zip(old, value, strict=True)]
            if averaging:
                area, period_ns = self._trapezoid(0.5 * share * span, old, here), self._period_ns
                here = [(a - b) / period_ns for a, b in zip(area, self._at_last_sample, strict=True)]
                self._at_last_sample = area
            self._sampled += 1
            self._schedule()
            self._sample(instant, here, due)
        if averaging:
            self._integral = self._trapezoid(0.5 * span, old, value)
        self._before = (stamp, value)

    def _trapezoid(self, half_span: float, old: list[float], new: list[float]) -> list[float]:
        """The integral, continued by twice ``half_span`` from ``old`` to ``new``."""
        return [total + half_span * (a + b) for total, a, b in zip(self._integral, old, new, strict=True)]

    def _sample(self, instant: int, true: list[float], due: list[tuple[int, list[float]]]) -> None:
        # The gauges' errors stand behind the analogue filter here: it is linear and the same for all six channels.
        t = instant * 1e-9
        ideal: list[float] = self._gain.dot(true).tolist()
        reading = [
            x + (bias + drift * t + noise)
            for x, bias, drift, noise in zip(ideal, self._bias, self._drift, next(self._noise), strict=True)
        ]
        if self._digital is not None:
            reading = self._digital.step(reading)
        if self._sampled % self._profile.oversampling == 0:
            due.append((instant, reading))


def _butterworth(order: int, corner: float) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
    """State space (A, B, C, D) of a digital Butterworth low-pass; ``corner`` in cycles a sample, below 0.5.

    The analogue poles, warped so that the corner stays in place, go through the bilinear transform; all zeros are
    at −1. (scipy.signal has it, and takes seconds to import.)
    """
    angles = math.pi * (2 * np.arange(order) + order + 1) / (2 * order)
    poles = math.tan(math.pi * corner) * np.exp(1j * angles)
    denominator = np.poly((1 + poles) / (1 - poles)).real
    numerator = np.poly(-np.ones(order)) * (denominator.sum() / 2.0**order)
    direct = numerator[0]
    companion = np.eye(order, k=-1)
    companion[0] = -denominator[1:]
    drive = np.eye(order, 1)
    return companion, drive, (numerator[1:] - direct * denominator[1:])[None, :], np.array([[direct]])


def _rotation(vector: np.ndarray) -> np.ndarray:
    """Rodrigues' formula for a rotation vector in rad."""
    angle = float(np.linalg.norm(vector))
    if angle == 0.0:
        return np.eye(3)
    x, y, z = vector / angle
    cross = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    return np.asarray(np.eye(3) + math.sin(angle) * cross + (1.0 - math.cos(angle)) * cross @ cross)
