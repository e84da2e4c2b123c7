"""What the drives' torques read while the drives are off: their offsets alone, whatever else the arm has.

A joint that rubs more one way than the other takes, in every motion, the torque of one that rubs alike beside an offset
of what its drive measures. With the power stage off no current flows: a torque by the motor's current then reads its
offset, while brakes, or a stop, hold the arm.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.diagnosis.observed.noise import Noise
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

RECORDING = -1
"""Number of the recording of such rows: they are of no motion."""
_STILL = 0.01
"""rad, m: what a joint may move by while its drive is off and a brake holds it."""
_PARTS = 20
"""Of a recording: their means scatter as its noise has it, slow as that may be."""
_HELD_UP = 0.5
"""Of what holds the arm up: a reading that has as much of it is that of drives that were on."""


@dataclass(frozen=True)
class OffReading:
    """``offset`` (n,) N·m (N) that the torques read, with its standard ``error``: infinite where a drive tells nothing
    while it is off. ``seconds`` of it."""

    offset: Array
    error: Array
    seconds: float

    @property
    def silent(self) -> list[int]:
        """Joints of which it tells nothing."""
        return [int(joint) for joint in np.flatnonzero(~np.isfinite(self.error))]


def read_off(body: RigidBody, recordings: Sequence[Trajectory]) -> OffReading:
    """The offsets from recordings with the drives off; a drive that then reads one number throughout measures nothing,
    and tells none.

    Raises InputError, naming the recording, when joints move in it, or its torques hold the arm up.
    """
    means, seconds = [], 0.0
    for recording in recordings:
        _at_rest(body, recording)
        parts = [part for part in np.array_split(recording.tau, _PARTS) if np.isfinite(part).any(axis=0).all()]
        if len(parts) < 2:
            raise InputError(recording.name, "has no torque of some joint", "record every joint's torque")
        means.append(np.array([np.nanmean(part, axis=0) for part in parts]))
        seconds += float(recording.t[-1] - recording.t[0])
        _not_held_up(body, recording, means[-1].mean(axis=0))
    every = np.concatenate(means)
    read = np.concatenate([recording.tau for recording in recordings])
    error = np.sqrt(every.var(axis=0, ddof=1) / len(every) + _rounding(read))
    error[np.nanmin(read, axis=0) == np.nanmax(read, axis=0)] = np.inf
    return OffReading(every.mean(axis=0), error, seconds)


def expected_reading(noise: Noise, torques: Sequence[int], seconds: float, band: float) -> OffReading:
    """What so many seconds would tell beside the ``noise`` of motions, whose rows have this ``band`` (Hz); ``torques``
    are the joints' channels. Drives that are off are hardly less sure of their torques than drives that are on."""
    slow = np.abs(noise.filters[list(torques)].sum(axis=1))
    error = 1.0 / (slow * np.sqrt(2.0 * band * seconds))
    return OffReading(np.zeros(len(error)), error, seconds)


def _at_rest(body: RigidBody, recording: Trajectory) -> None:
    moved = np.nanmax(recording.q, axis=0) - np.nanmin(recording.q, axis=0)
    joint = int(np.argmax(moved))
    if moved[joint] > _STILL:
        problem = f"moves {body.joints[joint]} by {moved[joint]:.3g} {body.axes[joint].unit('rad')}"
        raise InputError(recording.name, problem, "read the drives while they are off and brakes, or a stop, hold it")


def _not_held_up(body: RigidBody, recording: Trajectory, read: Array) -> None:
    """Raises InputError for torques that go with those that gravity asks for."""
    rest = np.nanmedian(recording.q, axis=0)[None]
    needed = inverse_dynamics(body, body.prior(), rest, np.zeros_like(rest), np.zeros_like(rest))[0]
    if needed @ needed > 0.0 and read @ needed > _HELD_UP * (needed @ needed):
        problem = "holds the arm up by its torques: the drives were on, or the torques are measured behind the gears"
        raise InputError(recording.name, problem, "record at rest with the drives off, or leave it out")


def _rounding(read: Array) -> Array:
    """(n,) variance of a mean of numbers in steps, beside the noise that lets them dither: the first harmonic of the
    sawtooth (Widrow and Kollár, Quantization Noise, 2008)."""
    result = np.zeros(read.shape[1])
    for joint, values in enumerate(read.T):
        levels = np.unique(values[np.isfinite(values)])
        if len(levels) > 1:
            step = float(np.diff(levels).min())
            result[joint] = (step / np.pi) ** 2 / 2.0 * np.exp(-((2.0 * np.pi * np.nanstd(values) / step) ** 2))
    return result
