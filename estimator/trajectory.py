"""One recorded motion as arrays, checked; and its cutting into segments without gaps."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace
from functools import cached_property
from itertools import pairwise
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config import InputError
from config.drive import COLDEST, HOTTEST

Array = NDArray[np.float64]

_JITTER_PERIODS, _JITTER = 3.0, 0.01
"""A pause of more than three periods that is also longer than 10 ms is a gap; what is shorter is interpolated."""
_LARGEST = 1e9
"""N·m, rad/s, rad/s²: far beyond any joint; a damaged number."""
_LARGEST_ANGLE = 400.0
"""rad; an arm's joint does not turn 60 times, but an angle in degrees reads like that."""


@dataclass(frozen=True)
class Trajectory:
    """A recorded motion; joints in the order of the `RigidBody`. Missing samples are NaN.

    ``t`` (samples,) s, rising, jitter allowed; ``q`` rad; ``tau`` N·m measured at the joint; ``dq`` rad/s and ``ddq``
    rad/s² where they were measured, otherwise they are differentiated. ``q_desired`` is the commanded motion: free of
    measurement noise, it gives the instruments of the instrumental-variable estimate. ``unusable``: torques that say
    nothing, of a sensor at the end of its range; that joint's equations leave them out. ``temperature`` °C of the
    joints, NaN of those without.

    Raises InputError when shapes disagree, time does not rise, the angles can only be degrees, the temperatures
    only kelvin, or a number is damaged.
    """

    t: Array
    q: Array
    tau: Array
    dq: Array | None = None
    ddq: Array | None = None
    q_desired: Array | None = None
    name: str = "trajectory"
    unusable: NDArray[np.bool_] | None = None
    temperature: Array | None = None

    def __post_init__(self) -> None:
        shape = np.shape(self.q)
        if np.ndim(self.t) != 1 or len(shape) != 2 or shape[0] != len(self.t):
            raise InputError(
                self.name,
                f"q has shape {shape} for {np.shape(self.t)} times",
                "give samples × joints and one time each",
            )
        for label in ("tau", "dq", "ddq", "q_desired", "unusable", "temperature"):
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
        largest = max(float(np.fmax.reduce(self.q, axis=None)), -float(np.fmin.reduce(self.q, axis=None)))
        if largest > _LARGEST_ANGLE:
            raise InputError(self.name, f"an angle of {largest:.0f} is no joint angle in rad", "convert degrees to rad")
        if self.temperature is not None and np.isfinite(self.temperature).any():
            low, high = float(np.nanmin(self.temperature)), float(np.nanmax(self.temperature))
            if low < COLDEST or high > HOTTEST:
                worst = low if low < COLDEST else high
                raise InputError(self.name, f"a temperature of {worst:.0f} is no joint's in °C", "convert kelvin to °C")
        for label in ("tau", "dq", "ddq"):
            value = getattr(self, label)
            if value is not None and np.nanmax(np.abs(value), initial=0.0) > _LARGEST:
                raise InputError(self.name, f"{label} holds values beyond {_LARGEST:.0e}", "check that column")

    @property
    def samples(self) -> int:
        return len(self.t)

    @cached_property
    def rate(self) -> float:
        """Typical sampling rate, Hz."""
        return float(1.0 / np.median(np.diff(self.t)))

    def segments(self, longest: int, overlap: int, commanded: bool = False) -> Iterator[NDArray[np.intp]]:
        """Indices of runs of whole samples without gaps, at most ``longest``; pieces of a run share ``overlap``.

        A sample with a NaN is left out; a few in a row are jitter, more are a gap. ``commanded``: samples must also
        have `q_desired`.
        """
        whole = self._whole(commanded)
        if len(whole) < 2:
            return
        times = self.t[whole]
        edges = [0, *(np.flatnonzero(np.diff(times) > self._longest_jitter()) + 1).tolist(), len(whole)]
        for begin, end in pairwise(edges):
            while end - begin > longest:
                yield whole[begin : begin + longest]
                begin += longest - overlap
            if end - begin >= 2:
                yield whole[begin:end]

    def missing(self) -> tuple[int, int]:
        """How many samples lack a channel, and how many gaps part the recording."""
        whole = self._whole(commanded=False)
        gaps = int(np.count_nonzero(np.diff(self.t[whole]) > self._longest_jitter()))
        return self.samples - len(whole), gaps

    def _longest_jitter(self) -> float:
        return max(_JITTER_PERIODS / self.rate, _JITTER)

    def rows(self, here: slice) -> Trajectory:
        """Some samples of all channels."""

        def cut(channel: NDArray[Any] | None) -> NDArray[Any] | None:
            return None if channel is None else channel[here]

        return replace(
            self,
            t=self.t[here],
            q=self.q[here],
            tau=self.tau[here],
            dq=cut(self.dq),
            ddq=cut(self.ddq),
            q_desired=cut(self.q_desired),
            unusable=cut(self.unusable),
            temperature=cut(self.temperature),
        )

    def _whole(self, commanded: bool) -> NDArray[np.intp]:
        good: NDArray[np.bool_] = np.ones(self.samples, dtype=np.bool_)
        each = np.ones(self.q.shape[1])
        for channel in (self.q, self.tau, self.dq, self.ddq, self.q_desired if commanded else None):
            if channel is not None:
                # A sum is finite where all its terms are, and much faster told.
                with np.errstate(invalid="ignore"):
                    good &= np.isfinite(np.asarray(channel, dtype=float) @ each)
        return np.flatnonzero(good)


def part_of(trajectory: Trajectory, begin: float, end: float) -> Trajectory:
    """The samples between two times (s, the trajectory's own), both included."""
    first, last = np.searchsorted(trajectory.t, [begin, end + 0.5 / trajectory.rate])
    return trajectory.rows(slice(max(0, int(first)), max(int(first) + 11, int(last))))
