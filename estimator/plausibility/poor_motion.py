"""Which motion recordings lack: what no analysis of them can tell, because the joint never did what would show it."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.plausibility.snapshot import rms, take
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_SLOWEST, _SLOWEST_SLIDING = 1e-3, 1e-4
"""rad/s and m/s: what never gets faster stands still, give or take a count of its encoder …"""
_BEYOND_NOISE = 10.0
"""… or is no faster than so many times the smoothed noise of its angle."""
_MOVES = 0.1
"""Of its rms speed: where a joint counts as moving."""
_ONE_WAY = 0.02
"""Share of the way back, to be a motion both ways."""
_ONE_SPEED = 0.15
"""Spread (standard deviation over mean) of a joint's speeds while it moves: those of a sine spread by 0.48, of a
trapezium with a tenth of its time on each ramp by 0.2."""


def missing_motions(body: RigidBody, trajectories: Sequence[Trajectory]) -> list[str]:
    """A sentence for each kind of motion that some joints lack, with what stays untold and what to record.

    Raises InputError when no joint moves at all, for nothing but gravity could be told of one pose.
    """
    shot = take(trajectories)
    if shot is None:
        return []
    still, one_way, one_speed = [], [], []
    noise = _speed_noise(trajectories, shot.band)
    for joint, (name, dq) in enumerate(zip(body.joints, shot.dq.T, strict=True)):
        slowest = _SLOWEST if body.axes[joint].revolute else _SLOWEST_SLIDING
        if np.abs(dq).max() < max(slowest, _BEYOND_NOISE * noise[joint]):
            still.append(name)
            continue
        speeds = dq[np.abs(dq) > _MOVES * rms(dq)]
        forth, back = float(np.sum(speeds[speeds > 0.0])), float(-np.sum(speeds[speeds < 0.0]))
        if min(forth, back) < _ONE_WAY * max(forth, back):
            one_way.append(name)
        elif np.std(np.abs(speeds)) < _ONE_SPEED * np.mean(np.abs(speeds)):
            one_speed.append(name)
    if len(still) == body.n:
        names = ", ".join(trajectory.name for trajectory in trajectories)
        raise InputError(names, "no joint moves", "record motions in which every joint turns both ways at many speeds")
    told = (
        (still, "never move", "nothing is told of friction, rotor or sensors there", "a motion of it, both ways"),
        (one_way, "move one way only", "friction there looks like an offset", "the same motion backwards as well"),
        (one_speed, "move at one speed only", "laws of friction look alike there", "slower and faster motions"),
    )
    return [f"{_subject(names, what)}: {untold}; record {motion}" for names, what, untold, motion in told if names]


def _subject(names: Sequence[str], what: str) -> str:
    return f"{', '.join(names)} {what.replace('move', 'moves') if len(names) == 1 else what}"


def _speed_noise(trajectories: Sequence[Trajectory], band: float) -> Array:
    """(n,) rad/s (m/s) rms that the angles' white noise, by its second differences, leaves in a snapshot's speeds."""
    noises = []
    for trajectory in trajectories:
        white = np.nanmedian(np.abs(np.diff(trajectory.q, 2, axis=0)), axis=0) / (0.6745 * np.sqrt(6.0))
        noises.append(white * 2.0 * np.pi * band * np.sqrt(2.0 * band / (3.0 * trajectory.rate)))
    return np.asarray(np.max(noises, axis=0))
