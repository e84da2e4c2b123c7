"""The wrench that was measured beside the one that the identified load needs, over time."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.filtering import plan_filter
from estimator.loads.estimate import LoadEstimate
from estimator.loads.recording import LoadRecording
from estimator.loads.rows import load_rows
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_FADING = 6
"""Rows at either end of a stretch over which the low-pass' kernel reaches beyond it."""


@dataclass(frozen=True)
class WrenchHistory:
    """``t`` (rows,) s; ``measured`` and ``predicted`` (rows, channels) N, N·m behind the low-pass of the estimate, the
    sensor's delay taken back; NaN rows between gapless stretches. ``channels``: their names."""

    t: Array
    measured: Array
    predicted: Array
    channels: tuple[str, ...]

    @property
    def residual(self) -> dict[str, dict[str, float]]:
        """Of each channel ``rms`` N or N·m, and ``relative`` to the measured wrench."""
        left = np.sqrt(np.nanmean((self.measured - self.predicted) ** 2, axis=0))
        size = np.sqrt(np.nanmean(self.measured**2, axis=0))
        return {
            name: {"rms": float(r), "relative": float(r / s) if s > 0.0 else 0.0}
            for name, r, s in zip(self.channels, left, size, strict=True)
        }


def wrench_history(
    body: RigidBody, frame: str, found: LoadEstimate, recording: LoadRecording, number: int | None = None
) -> WrenchHistory:
    """What ``found`` predicts for a recording: ``number`` of those it was learnt from, or None for another one.

    Where every recording has an offset of its own, another's is taken from it: it is the sensor's, not the load's.
    Raises InputError when the recording has no gapless stretch long enough.
    """
    layout = found.layout
    own = layout.offset_of_each and number is None
    plan = plan_filter(recording.motion.rate, found.band, stride_limit=1)
    t, measured, predicted = [], [], []
    gap = np.full((1, len(layout.channels)), np.nan)
    pieces = load_rows(body, frame, layout, recording, number or 0, plan, "differentiated", (found.delay.value,))
    for rows in pieces:
        whole = slice(_FADING, len(rows.t) - _FADING)
        if len(rows.t) <= 2 * _FADING:
            continue
        by_load = [found.fit.filled[layout.unknowns(k)[: 10 if own else None]] for k in range(len(layout.channels))]
        t += [rows.t[whole], rows.t[-1:]]
        measured += [np.array([c[-1] for c in rows.columns]).T[whole], gap]
        predicted += [np.array([p @ c[: len(p)] for p, c in zip(by_load, rows.columns, strict=True)]).T[whole], gap]
    if not t:
        raise InputError(
            recording.motion.name, "has no gapless stretch of motion and wrench long enough", "record it without gaps"
        )
    left, right = np.vstack(measured), np.vstack(predicted)
    if own:
        right = right + np.nanmean(left - right, axis=0)
    return WrenchHistory(np.concatenate(t), left, right, layout.names)
