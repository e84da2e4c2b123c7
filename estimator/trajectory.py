"""One recorded motion as arrays, checked; and its cutting into segments without gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from numpy.typing import NDArray

from config import InputError

Array = NDArray[np.float64]

_GAP_PERIODS = 12.0
"""A pause of more than this many median periods is a gap, not jitter."""
_LARGEST_ANGLE = 400.0
"""rad; an arm's joint does not turn 60 times, but an angle in degrees reads like that."""


@dataclass(frozen=True)
class Trajectory:
    """A recorded motion; joints in the order of the `RigidBody`. Missing samples are NaN.

    ``t`` (samples,) s, rising, jitter allowed; ``q`` rad; ``tau`` N·m measured at the joint; ``dq`` rad/s and ``ddq``
    rad/s² where they were measured, otherwise they are differentiated. ``q_desired`` is the commanded motion: free of
    measurement noise, it gives the instruments of the instrumental-variable estimate.

    Raises InputError when shapes disagree, time does not rise, or the angles can only be degrees.
    """

    t: Array
    q: Array
    tau: Array
    dq: Array | None = None
    ddq: Array | None = None
    q_desired: Array | None = None
    name: str = "trajectory"

    def __post_init__(self) -> None:
        shape = np.shape(self.q)
        if np.ndim(self.t) != 1 or len(shape) != 2 or shape[0] != len(self.t):
            raise InputError(
                self.name,
                f"q has shape {shape} for {np.shape(self.t)} times",
                "give samples × joints and one time each",
            )
        for label in ("tau", "dq", "ddq", "q_desired"):
            value = getattr(self, label)
            if value is not None and np.shape(value) != shape:
                raise InputError(self.name, f"{label} has shape {np.shape(value)}, q has {shape}", "align the channels")
        steps = np.diff(self.t)
        if len(steps) < 10:
            raise InputError(self.name, f"has {len(self.t)} samples", "record at least some seconds of motion")
        if not np.all(steps > 0.0):
            row = int(np.flatnonzero(~(steps > 0.0))[0]) + 1
            raise InputError(
                self.name, f"time does not rise at sample {row}", "sort the samples or split the recording"
            )
        if np.nanmax(np.abs(self.q)) > _LARGEST_ANGLE:
            raise InputError(
                self.name,
                f"an angle of {np.nanmax(np.abs(self.q)):.0f} is no joint angle in rad",
                "convert degrees to rad",
            )

    @property
    def samples(self) -> int:
        return len(self.t)

    @property
    def rate(self) -> float:
        """Typical sampling rate, Hz."""
        return float(1.0 / np.median(np.diff(self.t)))

    def segments(self, longest: int, overlap: int) -> Iterator[slice]:
        """Runs of samples without gaps and NaN, at most ``longest``; pieces of one run share ``overlap`` samples."""
        good: NDArray[np.bool_] = np.asarray(np.isfinite(np.hstack([self.tau, self.q])).all(axis=1))
        for channel in (self.dq, self.ddq, self.q_desired):
            if channel is not None:
                good &= np.asarray(np.isfinite(channel).all(axis=1))
        steps = np.diff(self.t)
        broken = np.logical_or(steps > _GAP_PERIODS * np.median(steps), ~(good[1:] & good[:-1]))
        edges = [0, *(np.flatnonzero(broken) + 1).tolist(), len(self.t)]
        for begin, end in pairwise(edges):
            if end - begin < 2 or not good[begin]:
                continue
            while end - begin > longest:
                yield slice(begin, begin + longest)
                begin += longest - overlap
            yield slice(begin, end)
