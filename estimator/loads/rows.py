"""From recordings of a load to rows: for each channel of the wrench [parameters | offset | drift | wrench].

Every column goes through the same linear operation as the wrench: either the low-pass that also decimates
(differentiated form, Eq. 3.12), or the mean over consecutive windows (integrated form, Eq. 3.21 to 3.23).
"""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter1d

from estimator.filtering import Decimator, FilterPlan, resample, smooth_motion
from estimator.loads.frame_motion import FrameMotion, frame_motion
from estimator.loads.recording import LoadRecording
from estimator.loads.wrench_regressor import CHANNELS, integrated_regressor, window_means, wrench_regressor
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK

Array = NDArray[np.float64]

Form = Literal["differentiated", "integrated"]
Offset = Literal["none", "constant", "drift"]

_REST = 0.01
"""Share of the recording's peak speed below which the arm counts as still."""


@dataclass(frozen=True)
class LoadLayout:
    """Which channels are fitted, and the unknowns: ten parameters, then offsets, then drifts of those channels."""

    channels: tuple[int, ...]
    offset: Offset

    @property
    def names(self) -> tuple[str, ...]:
        """Of the unknowns of the sensor, in the order of the solution."""
        mine = [CHANNELS[c] for c in self.channels]
        offsets = [f"offset {name}" for name in mine] if self.offset != "none" else []
        return tuple(offsets + ([f"drift {name}" for name in mine] if self.offset == "drift" else []))

    @property
    def size(self) -> int:
        return 10 + len(self.names)

    def unknowns(self, k: int) -> list[int]:
        """Where the columns of the k-th fitted channel stand among all unknowns."""
        extra = len(self.names) // len(self.channels)
        return [*range(10), *(10 + k + len(self.channels) * j for j in range(extra))]


@dataclass(frozen=True)
class LoadRows:
    """Rows of one gapless segment."""

    columns: list[Array]
    """For each fitted channel (columns + 1, rows), the wrench last."""
    still: NDArray[np.bool_]
    """(rows,) where the arm is at rest."""
    samples: int
    """Of the recording that are in these rows."""


def load_rows(
    body: RigidBody, frame: str, layout: LoadLayout, recording: LoadRecording, plan: FilterPlan, form: Form
) -> Iterator[LoadRows]:
    """Rows of a recording, segment by segment, so that memory does not grow with its length."""
    channels = np.array(layout.channels)
    for piece in recording.segments(channels, CHUNK, 2 * plan.edge):
        if len(piece) < 2 * plan.edge + 4 * plan.decimation:
            continue
        t = recording.motion.t[piece]
        q, dq, ddq = (
            None if x is None else resample(t, x[piece], plan.rate)
            for x in (recording.motion.q, recording.motion.dq, recording.motion.ddq)
        )
        assert q is not None
        inside = slice(plan.edge, len(q) - plan.edge)
        wrench = resample(t, recording.wrench[np.ix_(piece, channels)], plan.rate)[inside]
        smooth = smooth_motion(plan, q, dq, ddq)
        motion = frame_motion(body, frame, smooth.q, smooth.dq, smooth.ddq)
        clock = recording.session_start + t[0] + np.arange(len(q))[inside] / plan.rate
        still = _still(smooth.dq, plan.decimation)
        columns = _filtered(layout, motion, wrench, clock, plan, form)
        rows = columns[0].shape[1]
        yield LoadRows(columns, still[:: plan.decimation][:rows], len(piece))


def _filtered(
    layout: LoadLayout, motion: FrameMotion, wrench: Array, clock: Array, plan: FilterPlan, form: Form
) -> list[Array]:
    sensor = [np.ones_like(clock), clock][: {"none": 0, "constant": 1, "drift": 2}[layout.offset]]
    window = plan.decimation
    if form == "integrated":
        regressor = integrated_regressor(motion, plan.rate, window)
        sensor = [window_means(x, window) for x in sensor]
        wrench = window_means(wrench, window)
        return [np.vstack([regressor[:, c].T, *sensor, wrench[:, k]]) for k, c in enumerate(layout.channels)]
    regressor, decimate = wrench_regressor(motion), Decimator(window)
    return [decimate(np.vstack([regressor[:, c].T, *sensor, wrench[:, k]])) for k, c in enumerate(layout.channels)]


def _still(dq: Array, decimation: int) -> NDArray[np.bool_]:
    """Samples around which no joint moves, as far as one row sees."""
    speed = np.abs(dq).max(axis=1)
    return np.asarray(maximum_filter1d(speed, 4 * decimation + 1) < _REST * speed.max())
