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
CHANCE = 1.5
"""Times the noise that a smoothed spectrum of noise alone reaches easily."""
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

    ``frequency``: (lines,) Hz of the cosine spectrum. ``scatter``: (lines, n) N²·m², of one trial's measurement about
    the mean of others of the same command; ``counting``: the same of what such others share and another command does
    not, the error of an encoder's counts. ``band_hz``: beyond it nothing is learnt.

    What a trial says beyond the noise, averaged over neighbouring lines, is believed: friction answers to the motion
    itself, so that the correction which the arm needs changes while the motion comes nearer to the wanted one. Where
    a trial says nothing beyond the noise, the gain falls as one over the number of trials.
    """

    def __init__(self, frequency: Array, scatter: Array, band_hz: float, counting: Array | float = 0.0) -> None:
        self._scatter = np.maximum(scatter, np.finfo(float).tiny)
        self._counting = counting
        self._pass = low_pass(frequency, band_hz)[:, None]
        self._estimate = np.zeros_like(scatter)
        self._variance = np.zeros_like(scatter)

    @property
    def correction(self) -> Array:
        """(samples, n) N·m as estimated by now."""
        return to_history(self._pass * self._estimate)

    @property
    def variance(self) -> Array:
        """(lines, n) N²·m²: of the estimate's error, within the band."""
        return np.asarray(self._pass**2 * self._variance)

    def expect(self, measured: Array, repeats: int = 1) -> Surprise:
        """How far a measurement lies from the estimate. Takes nothing in; see `take`."""
        return Surprise(to_lines(measured) - self._estimate, self._variance + self._noise(repeats))

    def take(self, measured: Array, repeats: int = 1) -> None:
        """Take in one trial's measurement (samples × n, N·m), or the mean of ``repeats`` replays of one command."""
        surprise = self.expect(measured, repeats)
        noise = self._noise(repeats)
        shown = smoothed_power(surprise.innovation**2) - CHANCE * noise
        prior = np.maximum(self._variance, shown)
        share = prior / (prior + noise)
        self._estimate = self._estimate + share * surprise.innovation
        self._variance = share * noise + WANDER * self._noise()

    def _noise(self, repeats: int = 1) -> Array:
        """Of the mean of so many measurements of one command."""
        return np.asarray(self._scatter / repeats + self._counting)


def noise_of(measured: Array) -> Array:
    """(lines, n): spectrum of the scatter of replays' measurements (replays, samples, n), unbiased and smoothed."""
    about = measured - measured.mean(axis=0)
    power = np.array([to_lines(one) ** 2 for one in about]).sum(axis=0) / (len(measured) - 1)
    return smoothed_power(power)
