"""The trial filter: how far to believe each trial, frequency by frequency, in place of a hand-picked cut-off.

The correction that the arm needs is the same in every trial; what is measured of it has noise whose spectrum the
replays have shown. One Kalman filter a line of the cosine spectrum weighs the two. An operator of gain one plays each
trial's noise back into the next, and cannot come below √2 times the repeatability; this one comes down to it.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from learner.cosine_spectrum import low_pass, smoothed_power, to_history, to_lines

Array = NDArray[np.float64]
WANDER = 0.01
"""Variance by which the needed correction may change between two trials, as a share of the noise."""


@dataclass(frozen=True)
class Surprise:
    """What a trial said against what was expected of it: lines × n."""

    innovation: Array
    variance: Array
    """Expected of the innovation."""


class TrialFilter:
    """Estimates the correction (samples × n) over trials.

    ``frequency``: (lines,) Hz of the cosine spectrum. ``noise``: (lines, n) N²·m², of one trial's measurement.
    ``gain``: (lines,) of Λ: what a command error that is still there adds to the measurement through the model's
    faults. ``band_hz``: beyond it nothing is learnt.
    """

    def __init__(self, frequency: Array, noise: Array, gain: Array, band_hz: float) -> None:
        self.noise = np.maximum(noise, np.finfo(float).tiny)
        self._fault = np.minimum(gain, 1.0)[:, None] ** 2
        self._pass = low_pass(frequency, band_hz)[:, None]
        self._estimate = np.zeros_like(noise)
        self._variance: Array | None = None

    @property
    def correction(self) -> Array:
        """(samples, n) N·m as estimated by now."""
        return to_history(self._pass * self._estimate)

    @property
    def variance(self) -> Array:
        """(lines, n) N²·m²: of the estimate's error, within the band."""
        return self._pass**2 * (self.noise if self._variance is None else self._variance)

    def expect(self, measured: Array, command_error: Array, repeats: int = 1) -> Surprise:
        """How far a measurement lies from the estimate. Takes nothing in; see `take`."""
        innovation = to_lines(measured) - self._estimate
        spread = self._trusted(command_error, repeats)
        prior = self._variance if self._variance is not None else self._first(innovation, spread)
        return Surprise(innovation, prior + spread)

    def take(self, measured: Array, command_error: Array, repeats: int = 1) -> Surprise:
        """Take in one trial's measurement (samples × n, N·m), or the mean of ``repeats`` replays of one command.

        ``command_error``: δû of the trial (Eq. 6.7), whose image by the model's faults is noise of this trial too.
        """
        surprise = self.expect(measured, command_error, repeats)
        prior = surprise.variance - self._trusted(command_error, repeats)
        share = prior / surprise.variance
        self._estimate = self._estimate + share * surprise.innovation
        self._variance = (1.0 - share) * prior + WANDER * self.noise
        return surprise

    def _trusted(self, command_error: Array, repeats: int) -> Array:
        return self.noise / repeats + self._fault * smoothed_power(to_lines(command_error) ** 2)

    def _first(self, innovation: Array, spread: Array) -> Array:
        # Before the first trial nothing is known: the repeatable part's spectrum is what exceeds the noise.
        return np.maximum(smoothed_power(innovation**2) - spread, 1e-3 * spread)


def noise_of(measured: Array) -> Array:
    """(lines, n): spectrum of the scatter of replays' measurements (replays, samples, n), unbiased and smoothed."""
    about = measured - measured.mean(axis=0)
    power = np.array([to_lines(one) ** 2 for one in about]).sum(axis=0) / (len(measured) - 1)
    return smoothed_power(power)
