"""Recordings whose angles go on from sample to sample, as those of joints do."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import InputError
from driver.recording import Recording
from estimator.plausibility import about, how_far, leaps, turns
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_TURN = 2.0 * np.pi
_MOST = 0.01
"""Of the samples: more that are damaged are no accident."""
_AS_FAR = 0.9
"""Of the largest leap, what others must be to be as large."""


@dataclass(frozen=True)
class _Angles:
    """Copies of one joint's angles in a recording, to be mended in place."""

    q: Array
    others: tuple[Array, ...]
    """(samples,) each: as desired, and by the motor, where they were recorded."""


def continuous(recordings: Sequence[Recording], body: RigidBody) -> tuple[list[Recording], list[str]]:
    """The recordings with angles that are told within one turn going on over it, in the same turn in all of them, and
    without what lies about a leap; and what a reader should be told of that.

    Raises InputError where an angle leaps too often to be damaged by accident.
    """
    copies = [
        replace(
            r,
            q=np.array(r.q, dtype=float),
            q_d=None if r.q_d is None else np.array(r.q_d, dtype=float),
            q_motor=None if r.q_motor is None else np.array(r.q_motor, dtype=float),
        )
        for r in recordings
    ]
    notes = []
    for joint, axis in zip(body.joints, body.axes, strict=True):
        angles = [_angles(r, r.joints.index(joint)) for r in copies if joint in r.joints]
        if axis.revolute and _go_on(angles):
            notes.append(f"the angle of {joint} is told within one turn: it is taken as going on over it")
    for recording in copies:
        notes += _without_leaps(recording, body)
    return copies, notes


def _angles(recording: Recording, column: int) -> _Angles:
    others = (x[:, column] for x in (recording.q_d, recording.q_motor) if x is not None)
    return _Angles(recording.q[:, column], tuple(others))


def _go_on(recorded: Sequence[_Angles]) -> bool:
    """Lets one joint's angles go on over whole turns; whether they had to."""
    had_to = [_turned(angle) for angles in recorded for angle in (angles.q, *angles.others)]
    if not any(had_to):
        return False
    first = float(np.nanmedian(recorded[0].q))
    for angles in recorded:
        angles.q[:] -= _TURN * np.round((np.nanmedian(angles.q) - first) / _TURN)
        for other in angles.others:
            apart = other - angles.q
            if np.isfinite(apart).any():
                other -= _TURN * np.round(np.nanmedian(apart) / _TURN)
    return True


def _turned(angle: Array) -> bool:
    whole = turns(angle)
    if not np.any(whole[np.isfinite(whole)]):
        return False
    angle += _TURN * np.where(np.isfinite(whole), whole, 0.0)
    return True


def _without_leaps(recording: Recording, body: RigidBody) -> list[str]:
    """Leaves out what lies about a leap, and says so."""
    damaged, notes = np.zeros(len(recording.q), dtype=np.bool_), []
    for joint, column, axis in zip(body.joints, body.columns(recording.joints), body.axes, strict=True):
        places = leaps(recording.t, recording.q[:, column])
        if not len(places):
            continue
        hurt = about(recording.t, places)
        told = _told(recording, joint, column, "rad" if axis.revolute else "m", places)
        if np.mean(hurt) > _MOST:
            degrees = ", or convert the angles if they are in degrees" if axis.revolute else ""
            remedy = f"repair that angle, or cut the recording there{degrees}"
            raise InputError(str(recording.path), f"{told}, as no joint moves", remedy)
        notes.append(f"{recording.path.name}: {told}, as no joint moves: what lies about it is left out")
        damaged |= hurt
    recording.q[damaged] = np.nan
    return notes


def _told(recording: Recording, joint: str, column: int, unit: str, places: NDArray[np.intp]) -> str:
    """Of several leaps the first of the largest."""
    sizes = how_far(recording.t, recording.q[:, column], places)
    largest = int(np.argmax(sizes > _AS_FAR * np.max(sizes)))
    by, at = f"by {sizes[largest]:.2g} {unit}", f"at {recording.t[places[largest]]:.2f} s"
    if len(places) == 1:
        return f"{joint} leaps {by} from one sample to the next {at}"
    return f"{joint} leaps {len(places)} times from one sample to the next, farthest {by} {at}"
