"""Where the arm rested in a recording, and what its wrist felt there: data of the static identification."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d, minimum_filter1d

from config import InputError
from estimator.loads.recording import LoadRecording

Array = NDArray[np.float64]

_WINDOW = 0.2
_MOVED = 2e-3
"""rad (m) within a window: more is no rest."""
_SETTLING = 0.5
"""s after a stop that do not count: loads swing on their sensors for that long."""
_LEAST = 0.3
"""s of rest behind that for a mean worth having."""


@dataclass(frozen=True)
class Poses:
    """Means over rests: ``q`` (poses, n) rad, ``wrench`` (poses, 6) N, N·m, ``t`` (poses,) s of session time at their
    middles, ``error`` (poses, 6): standard errors of the means under coloured noise."""

    q: Array
    wrench: Array
    t: Array
    error: Array


def resting_poses(recordings: Sequence[LoadRecording]) -> Poses:
    """Every rest of the recordings. Raises InputError when there is none."""
    found: list[tuple[Array, Array, float, Array]] = []
    for recording in recordings:
        t, q = recording.motion.t, recording.motion.q
        window = max(3, round(_WINDOW * recording.motion.rate))
        travel = maximum_filter1d(q, window, axis=0) - minimum_filter1d(q, window, axis=0)
        still = np.asarray((travel < _MOVED).all(axis=1))
        edges = np.flatnonzero(np.diff(np.concatenate([[False], still, [False]])))
        for begin, end in edges.reshape(-1, 2):
            # A recording that begins at rest has settled before.
            since = t[begin] + (_SETTLING if begin > 0 else 0.0)
            inside = np.arange(begin, end)[t[begin:end] >= since]
            whole = inside[np.isfinite(recording.wrench[inside]).any(axis=1)]
            if len(whole) > window and t[whole[-1]] - t[whole[0]] >= _LEAST:
                reading = recording.wrench[whole]
                middle = recording.session_start + float(t[whole].mean())
                found.append((q[whole].mean(axis=0), reading.mean(axis=0), middle, error_of_mean(reading)))
    if not found:
        raise InputError(
            "recordings",
            f"the arm never rests {_SETTLING + _LEAST:.2g} s in them",
            "record a motion that stops in several poses (dwell_s of a motion file)",
        )
    q_, wrench_, t_, error_ = zip(*found, strict=True)
    return Poses(np.array(q_), np.array(wrench_), np.array(t_), np.array(error_))


def error_of_mean(samples: Array, parts: int = 8) -> Array:
    """(channels,) standard error of the mean of coloured ``samples`` (samples, channels), from means of parts."""
    cut = samples[: len(samples) // parts * parts].reshape(parts, -1, samples.shape[1]).mean(axis=1)
    return np.asarray(cut.std(axis=0, ddof=1) / np.sqrt(parts))
