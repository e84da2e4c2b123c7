"""A motion to be learnt, and one attempt at it, on the same samples."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Timing:
    """When a sample of torque acts. Torque sample k of a `Trial` acts, on the mean, at k − ½ samples where a torque is
    held from one sample to the next (``held``), else at k. What is sent at sample j is torque sample j + ``advance``,
    one number for all joints or (n,): a motor's own lag is part of it.
    """

    held: bool
    advance: float | Array

    def command(self, torque: Array) -> Array:
        """What to send, so that ``torque`` (samples × n, in time with a trial's torque) acts; the end is held."""
        at = np.arange(len(torque), dtype=float)
        ahead = np.broadcast_to(self.advance, torque.shape[1])
        return np.column_stack([np.interp(at + a, at, column) for a, column in zip(ahead, torque.T, strict=True)])


@dataclass(frozen=True)
class Reference:
    """The wanted motion: ``q``, ``dq``, ``ddq`` (samples × n; rad, rad/s, rad/s²), every ``period`` s.

    It begins and ends at rest; ``moving`` are the samples between, over which errors are counted.
    """

    q: Array
    dq: Array
    ddq: Array
    period: float
    moving: slice

    @property
    def samples(self) -> int:
        return len(self.q)

    @property
    def n(self) -> int:
        return int(self.q.shape[1])

    @classmethod
    def between_rests(cls, q: Array, dq: Array, ddq: Array, period: float, before: int, after: int) -> Reference:
        """The motion with that many samples of rest at its beginning and its end."""
        ends = ((before, after), (0, 0))
        return cls(
            np.pad(q, ends, mode="edge"), np.pad(dq, ends), np.pad(ddq, ends), period, slice(before, before + len(q))
        )


@dataclass(frozen=True)
class Trial:
    """One attempt: what was measured in time with the reference, samples × n.

    ``tau`` N·m is the whole motor torque uⁱ, feedforward and feedback, and acts as `Timing` says.
    """

    q: Array
    dq: Array
    tau: Array

    def check(self, reference: Reference, name: str = "trial") -> None:
        """Raise InputError when the trial is cut short or has samples missing."""
        for label, array in (("q", self.q), ("dq", self.dq), ("tau", self.tau)):
            if array.shape != reference.q.shape:
                raise InputError(
                    name,
                    f"{label} has {len(array)} samples of the motion's {reference.samples}",
                    "a trial that was cut short teaches nothing: play the motion to its end",
                )
            if not np.isfinite(array).all():
                row, joint = (int(k) for k in np.argwhere(~np.isfinite(array))[0])
                raise InputError(
                    name,
                    f"{label} of joint number {joint + 1} is missing at {row * reference.period:.3f} s",
                    "repeat the trial",
                )

    def velocity_error_rms(self, reference: Reference) -> Array:
        """(n,) rad/s over the moving samples: the thesis' index of performance (Section 6.4)."""
        error = (self.dq - reference.dq)[reference.moving]
        return np.asarray(np.sqrt(np.mean(error**2, axis=0)))

    def position_error_peak(self, reference: Reference) -> Array:
        """(n,) rad over the moving samples."""
        return np.asarray(np.max(np.abs((self.q - reference.q)[reference.moving]), axis=0))
