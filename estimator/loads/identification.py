"""Identifies a rigid load from the wrenches of the wrist sensor while the arm moves (thesis, chapter 3)."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.delays import Delay
from estimator.filtering import motion_band, plan_filter
from estimator.loads.delay import SHIFTS, UNKNOWN_DELAY, fit_with_delay
from estimator.loads.estimate import LoadEstimate
from estimator.loads.fit import Believed, LoadFit
from estimator.loads.layout import LoadLayout, Offset, wrench_layout
from estimator.loads.parameters import RigidLoad
from estimator.loads.recording import LoadRecording
from estimator.loads.rigidity import ResidualRows, rigidity
from estimator.loads.rows import Form, load_rows, resting_speed
from estimator.loads.tare import Tare
from estimator.loads.wrench_regressor import CHANNELS
from estimator.rigid_body import RigidBody
from estimator.sums import Sums

Array = NDArray[np.float64]

_BAND_OVER_MOTION = 10.0
_LEAST_BAND, _WIDEST_BAND = 5.0, 25.0
"""Hz, as for links: above, arm and sensor swing."""
_LEAST_ROWS = 8
_LEAST_TRAVEL = 0.02
"""rad (m) by which at least one joint must move."""


@dataclass(frozen=True)
class LoadOptions:
    """``band_hz`` None: taken from the motion. ``offset``: what of the sensor is estimated with the load.

    ``sensor_range`` (6,) N, N·m: samples at the limit are left out and told. ``delay``: what is believed of how late
    the sensor is; it is estimated with the load, unless its standard error is zero.
    """

    form: Form = "differentiated"
    offset: Offset = "constant"
    band_hz: float | None = None
    sensor_range: Array | None = None
    delay: Delay = UNKNOWN_DELAY


def identify_load(
    body: RigidBody,
    frame: str,
    recordings: Sequence[LoadRecording],
    hand: RigidLoad | None = None,
    tares: Sequence[Tare] = (),
    prior: RigidLoad | None = None,
    options: LoadOptions | None = None,
) -> LoadEstimate:
    """Mass, centre and inertia with standard errors that hold under coloured noise, the sensor's offsets, residuals.

    ``frame`` is the sensor's, a link of the URDF. The ``hand``, identified in the same frame, is subtracted and its
    errors are added. ``tares`` pin the offsets down; with two or more, ``offset="drift"`` lets them change linearly.
    A ``prior`` (of the load without the hand) with its covariance is combined with the data. Channels of the wrench
    that any recording lacks are dropped.

    Raises InputError for recordings that do not fit the arm or are too short, and for tares without an offset.
    """
    options = options or LoadOptions()
    _check(body, recordings, tares, options)
    if not tares and prior is None:
        _require_motion(recordings)
    recordings, warnings = _usable(recordings, options)
    band = options.band_hz or float(
        np.clip(_BAND_OVER_MOTION * motion_band([r.motion for r in recordings]), _LEAST_BAND, _WIDEST_BAND)
    )
    measured = np.logical_and.reduce([r.measured for r in recordings])
    if not measured.any():
        raise InputError("recordings", "have no channel of the wrench in common", "record all with the same sensor")
    if not measured.all():
        missing = ", ".join(name for name, there in zip(CHANNELS, measured, strict=True) if not there)
        warnings.append(f"{missing} not measured: dropped")
    layout = wrench_layout(tuple(np.flatnonzero(measured).tolist()), options.offset, len(recordings))
    sums = Sums()
    for number, recording in enumerate(recordings):
        plan = plan_filter(recording.motion.rate, band, stride_limit=1)
        for rows in load_rows(body, frame, layout, recording, number, plan, options.form, SHIFTS):
            sums.add(rows.columns, number)
            sums.samples += rows.samples
    if sums.rows < _LEAST_ROWS:
        raise InputError(
            "recordings",
            f"have {sums.rows} rows of gapless motion at {band:.3g} Hz, {_LEAST_ROWS} are needed",
            "record longer motion without gaps",
        )
    fit, delay = fit_with_delay(layout, sums, _believed(layout, tares, prior, hand), options.delay)
    resting = resting_speed(recordings)
    residuals = [
        _residuals(body, frame, layout, recording, number, band, options.form, fit, delay.value, resting)
        for number, recording in enumerate(recordings)
    ]
    load = RigidLoad(fit.value[:10], fit.covariance[:10, :10])
    return LoadEstimate(
        load=load if hand is None else load.without(hand),
        fit=fit,
        layout=layout,
        band=band,
        samples=sums.samples,
        rows=sums.rows,
        form=options.form,
        delay=delay,
        rigid=rigidity(residuals, fit, [r.motion.name for r in recordings]),
        warnings=tuple(warnings),
    )


def _check(body: RigidBody, recordings: Sequence[LoadRecording], tares: Sequence[Tare], options: LoadOptions) -> None:
    if not recordings:
        raise InputError("recordings", "there are none", "give at least one")
    for recording in recordings:
        joints = recording.motion.q.shape[1]
        if joints != body.n:
            raise InputError(
                recording.motion.name,
                f"has {joints} joints, the arm has {body.n} ({', '.join(body.joints)})",
                "select the arm's joints, or hold the others",
            )
    if tares and options.offset in ("none", "each"):
        raise InputError(
            "tares", "say what the sensor's offset is, but no common one is estimated", "fit one, constant or drifting"
        )
    for tare in tares:
        if np.shape(tare.offset) != (6,) or np.shape(tare.standard_error) != (6,):
            raise InputError("tares", "an offset or its standard error is not six numbers", "give (6,) each")
        if not np.all(np.asarray(tare.standard_error) > 0.0):
            raise InputError("tares", "a standard error is not positive", "average a tare over several samples")


def _require_motion(recordings: Sequence[LoadRecording]) -> None:
    """In one pose the sensor's offset and the load's weight are the same thing."""
    highest = np.max([np.fmax.reduce(r.motion.q, axis=0) for r in recordings], axis=0)
    lowest = np.min([np.fmin.reduce(r.motion.q, axis=0) for r in recordings], axis=0)
    travel = float(np.max(highest - lowest))
    if travel < _LEAST_TRAVEL:
        raise InputError(
            recordings[0].motion.name,
            f"the arm moves by {travel:.2g} rad at most: the load's weight is not told from the sensor's offset",
            "record motion that turns the load against gravity, or give a tare",
        )


def _usable(recordings: Sequence[LoadRecording], options: LoadOptions) -> tuple[list[LoadRecording], list[str]]:
    """Recordings without saturated samples, and what was left out."""
    result, warnings = [], []
    for recording in recordings:
        if options.sensor_range is not None:
            at_limit = recording.saturated(np.asarray(options.sensor_range))
            if at_limit.any():
                whole = np.where(at_limit[:, None], np.nan, recording.wrench)
                if not np.isfinite(whole).any():
                    raise InputError(recording.motion.name, "the sensor is at its limit throughout", "a lighter load")
                recording = replace(recording, wrench=whole)
                warnings.append(
                    f"{recording.motion.name}: the sensor is at its limit in {int(at_limit.sum())} samples, left out"
                )
        result.append(recording)
    return result, warnings


def _believed(
    layout: LoadLayout, tares: Sequence[Tare], prior: RigidLoad | None, hand: RigidLoad | None
) -> list[Believed]:
    """Tares on the sensor's unknowns; the prior, the hand added, on the load's."""
    result = []
    count = len(layout.channels)
    for tare in tares:
        rows = np.zeros((count, layout.size))
        rows[:, layout.place("offset")] = np.eye(count)
        if "drift" in layout.kinds:
            rows[:, layout.place("drift")] = tare.t * np.eye(count)
        mine = list(layout.channels)
        result.append(
            Believed(rows, np.asarray(tare.offset)[mine], np.diag(np.asarray(tare.standard_error)[mine] ** 2))
        )
    if prior is not None:
        known = np.flatnonzero(np.isfinite(prior.parameters))
        carried = prior.parameters + (0.0 if hand is None else hand.parameters)
        result.append(Believed(np.eye(layout.size)[known], carried[known], prior.covariance[np.ix_(known, known)]))
    return result


def _residuals(
    body: RigidBody,
    frame: str,
    layout: LoadLayout,
    recording: LoadRecording,
    number: int,
    band: float,
    form: Form,
    fit: LoadFit,
    delay: float,
    resting: float,
) -> ResidualRows:
    """Second pass: what the fit leaves of each row, and what it explains by the load."""
    plan = plan_filter(recording.motion.rate, band, stride_limit=1)
    left, explained, still = [], [], []
    for rows in load_rows(body, frame, layout, recording, number, plan, form, (delay,), resting):
        predicted = np.array([fit.filled[layout.unknowns(k)] @ c[:-1] for k, c in enumerate(rows.columns)])
        by_load = np.array([fit.filled[:10] @ c[:10] for c in rows.columns])
        left.append(np.array([c[-1] for c in rows.columns]) - predicted)
        explained.append(by_load)
        still.append(rows.still)
    if not left:
        nothing = np.zeros((len(layout.channels), 0))
        return ResidualRows(nothing, nothing, np.zeros(0, dtype=np.bool_))
    return ResidualRows(np.hstack(left), np.hstack(explained), np.concatenate(still))
