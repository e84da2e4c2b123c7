"""From recordings of a load to rows: for each channel of the wrench [parameters | sensor | wrench].

Every column goes through the same linear operation as the wrench: either the low-pass that also decimates
(differentiated form, Eq. 3.12), or the same low-pass and then the mean over consecutive windows (integrated form,
Eq. 3.21 to 3.23).
"""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from estimator.filtering import Decimator, FilterPlan, resample, smooth_motion
from estimator.loads.frame_motion import FrameMotion, frame_motion
from estimator.loads.integrated import integrated_columns, lost_samples
from estimator.loads.layout import LoadLayout, sensor_columns
from estimator.loads.recording import LoadRecording
from estimator.loads.wrench_regressor import wrench_regressor
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK

Array = NDArray[np.float64]

Form = Literal["differentiated", "integrated"]

_REST = 0.01
"""Share of the recordings' peak speed below which the arm counts as still."""
_SPEED_S = 0.05
"""s over which a speed is a mean."""


@dataclass(frozen=True)
class LoadRows:
    """Rows of one gapless segment."""

    columns: list[Array]
    """For each fitted channel (columns + shifts, rows), the wrench at each shift last."""
    still: NDArray[np.bool_]
    """(rows,) where the arm is at rest."""
    t: Array
    """(rows,) s on the recording's clock."""
    samples: int
    """Of the recording that are in these rows."""


def load_rows(
    body: RigidBody,
    frame: str,
    layout: LoadLayout,
    recording: LoadRecording,
    number: int,
    plan: FilterPlan,
    form: Form,
    shifts: ArrayLike = (0.0,),
    resting: float = 0.0,
) -> Iterator[LoadRows]:
    """Rows of recording ``number``, segment by segment, so that memory does not grow with its length.

    The wrench that stands beside the motion at t was measured at t + shift, s. ``resting``: of a joint, rad/s.
    """
    channels, shifts = np.array(layout.channels), np.asarray(shifts, dtype=float)
    edge = max(plan.edge, int(np.ceil(np.abs(shifts).max() * plan.rate)) + 1)
    least, first = 4 * plan.decimation, 0
    if form == "integrated":
        least, first = least + lost_samples(plan.decimation), (lost_samples(plan.decimation) + plan.decimation) // 2
    for piece in recording.segments(channels, CHUNK, 2 * edge):
        if len(piece) < 2 * edge + least:
            continue
        t = recording.motion.t[piece]
        q, dq, ddq = (
            None if x is None else resample(t, x[piece], plan.rate)
            for x in (recording.motion.q, recording.motion.dq, recording.motion.ddq)
        )
        assert q is not None
        inside = np.arange(edge, len(q) - edge)
        measured = resample(t, recording.wrench[np.ix_(piece, channels)], plan.rate)
        smooth = smooth_motion(plan, q, dq, ddq)
        kept = slice(edge - plan.edge, edge - plan.edge + len(inside))
        motion = frame_motion(body, frame, smooth.q[kept], smooth.dq[kept], smooth.ddq[kept])
        clock = t[0] + inside / plan.rate
        right = sensor_columns(layout, recording.session_start + clock, number)
        wrenches = _shifted(measured, inside, shifts * plan.rate)
        columns = _filtered(layout, motion, right, wrenches, plan, form)
        rows = columns[0].shape[1]
        still = _still(smooth.dq[kept], plan.decimation, resting)[first :: plan.decimation][:rows]
        yield LoadRows(columns, still, clock[first :: plan.decimation][:rows], len(piece))


def _shifted(measured: Array, inside: NDArray[np.intp], shifts: Array) -> list[Array]:
    """The channels at each shift, in samples: (samples, channels)."""
    if not np.any(shifts):
        return [measured[inside]]
    spline = CubicSpline(np.arange(len(measured), dtype=float), measured)
    return [np.asarray(spline(inside + shift)) for shift in shifts]


def _filtered(
    layout: LoadLayout, motion: FrameMotion, sensor: list[Array], wrenches: list[Array], plan: FilterPlan, form: Form
) -> list[Array]:
    if form == "integrated":
        return integrated_columns(layout.channels, motion, sensor, wrenches, plan)
    regressor, decimate = wrench_regressor(motion), Decimator(plan.decimation)
    return [
        decimate(np.vstack([regressor[:, c].T, *sensor, *(w[:, k] for w in wrenches)]))
        for k, c in enumerate(layout.channels)
    ]


def _still(dq: Array, decimation: int, resting: float) -> NDArray[np.bool_]:
    """Samples around which no joint moves, as far as one row sees."""
    speed = np.abs(dq).max(axis=1)
    return np.asarray(maximum_filter1d(speed, 4 * decimation + 1) < resting)


def resting_speed(recordings: Sequence[LoadRecording]) -> float:
    """rad/s below which a joint counts as still, by how fast the recordings are at most."""
    fastest = 0.0
    for recording in recordings:
        apart = max(1, round(_SPEED_S * recording.motion.rate))
        t, q = recording.motion.t, recording.motion.q
        if len(t) > apart:
            speed = np.abs(q[apart:] - q[:-apart]) / (t[apart:] - t[:-apart])[:, None]
            fastest = max(fastest, float(np.fmax.reduce(speed, axis=None, initial=0.0)))
    return _REST * fastest
