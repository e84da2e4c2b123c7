"""One recorded motion of a load: the arm's angles and the wrist's wrench on one time base, checked."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from config import InputError
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_LARGEST_GAP = 3.5
"""Wrench samples further apart than that many periods are not bridged."""
_AT_LIMIT = 0.995


@dataclass(frozen=True)
class LoadRecording:
    """``wrench`` (samples, 6) N, N·m in the sensor's frame at the times of ``motion``, NaN where it is missing.

    A channel that is NaN throughout is missing and is dropped. Torques of ``motion`` are not read. Make it with
    `align_wrench` when the sensor has times of its own. Raises InputError when shapes disagree or nothing is measured.
    """

    motion: Trajectory
    wrench: Array
    session_start: float = 0.0
    """s: where zero of the motion's time lies on the clock of the session, on which offsets drift."""

    def __post_init__(self) -> None:
        if np.shape(self.wrench) != (self.motion.samples, 6):
            raise InputError(
                self.motion.name,
                f"the wrench has shape {np.shape(self.wrench)} for {self.motion.samples} samples",
                "give samples × (fx, fy, fz, nx, ny, nz) at the times of the motion",
            )
        if not self.measured.any():
            raise InputError(self.motion.name, "no channel of the wrench has a number in it", "record the wrist sensor")

    @property
    def measured(self) -> NDArray[np.bool_]:
        """(6,) which channels are there at all."""
        return np.asarray(np.isfinite(self.wrench).any(axis=0))

    def segments(self, channels: NDArray[np.intp], longest: int, overlap: int) -> Iterator[NDArray[np.intp]]:
        """As `Trajectory.segments`, of samples whose motion and wrench (of the ``channels`` asked for) are whole."""
        whole = np.asarray(np.isfinite(self.wrench[:, channels]).all(axis=1))
        # Torques are not read here: the channel carries where the wrench is missing instead.
        marked = np.where(whole[:, None], 0.0, np.nan) * np.ones(self.motion.q.shape[1])
        return replace(self.motion, tau=marked, q_desired=None).segments(longest, overlap)

    def saturated(self, limits: Array) -> NDArray[np.bool_]:
        """(samples,) where a channel reads (nearly) the sensor's limit, ``limits`` (6,): what it felt was more."""
        with np.errstate(invalid="ignore"):
            return np.asarray((np.abs(self.wrench) >= _AT_LIMIT * limits).any(axis=1))


def align_wrench(motion: Trajectory, wrench_t: Array, wrench: Array, delay: float = 0.0) -> LoadRecording:
    """Brings a sensor's samples (``wrench_t`` (k,) s, ``wrench`` (k, 6)) to the times of the motion.

    ``delay`` s: how late the sensor is, its own filter included; it is taken back. A cubic between neighbouring
    samples changes nothing in the band of an arm's motion. NaN outside the sensor's record and across its gaps.
    Raises InputError when the sensor's time does not rise or shapes disagree.
    """
    wrench_t, wrench = np.asarray(wrench_t, dtype=float), np.asarray(wrench, dtype=float)
    if wrench.ndim != 2 or wrench.shape[1] != 6 or wrench_t.shape != (len(wrench),):
        raise InputError(motion.name, f"the wrench has shape {wrench.shape} for {wrench_t.shape} times", "give k × 6")
    if not np.all(np.diff(wrench_t) > 0.0):
        raise InputError(motion.name, "the wrench's time does not rise", "sort its samples or split the recording")
    there = np.isfinite(wrench).any(axis=0)
    good = np.isfinite(wrench[:, there]).all(axis=1)
    result = np.full((motion.samples, 6), np.nan)
    times, values = wrench_t[good] - delay, wrench[good][:, there]
    if len(times) < 4:
        raise InputError(motion.name, f"has {len(times)} whole samples of the wrench", "record the wrist sensor")
    after = np.clip(np.searchsorted(times, motion.t), 1, len(times) - 1)
    bridged = times[after] - times[after - 1] <= _LARGEST_GAP * float(np.median(np.diff(wrench_t)))
    inside = (motion.t >= times[0]) & (motion.t <= times[-1]) & bridged
    result[np.ix_(inside, there)] = CubicSpline(times, values)(motion.t[inside])
    return LoadRecording(motion, result)
