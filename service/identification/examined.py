"""Recordings examined before anything is fitted to them: what cannot be this arm's in SI units is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

import numpy as np

from config import InputError
from estimator.plausibility import (
    Doubt,
    check_times,
    contradicting,
    examine,
    examine_motion,
    without_dead_velocities,
    without_unusable_torques,
)
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory


def examined(
    body: RigidBody, trajectories: Sequence[Trajectory], believed: bool = False
) -> tuple[list[Trajectory], list[str]]:
    """The recordings with unusable torques marked, and a sentence for each thing that is doubtful about them.

    ``believed``: the body's masses are the model that is to be judged, see `estimator.plausibility.examine`.
    Raises InputError when units, signs or the order of joints are wrong beyond doubt: nothing is fitted over that.
    """
    if not trajectories:
        return [], []
    usable, doubts = _usable(body, trajectories)
    doubts += examine(body, usable, believed)
    if believed:
        _refuse_contradicting(body, usable, usable, doubts)
    _refuse_what_is_wrong(body, doubts, trajectories)
    return usable, [str(doubt) for doubt in doubts]


def examined_beside(
    body: RigidBody, learnt: Sequence[Trajectory], judged: Sequence[Trajectory]
) -> tuple[list[Trajectory], list[str]]:
    """As `examined`, of recordings held out: by what those learnt from say of them. They may be too short to tell by
    themselves how their channels are to be read.

    Raises InputError as that does. A body without masses says nothing of the one from the other.
    """
    if not judged or not np.any(body.prior()[::10] > 0.0):
        return examined(body, judged, believed=True)
    usable, doubts = _usable(body, judged)
    doubts += examine_motion(body, usable)
    _refuse_what_is_wrong(body, doubts, judged)
    _refuse_contradicting(body, learnt, usable, [])
    return usable, [str(doubt) for doubt in doubts]


def _usable(body: RigidBody, trajectories: Sequence[Trajectory]) -> tuple[list[Trajectory], list[Doubt]]:
    for trajectory in trajectories:
        check_times(trajectory)
    moving, doubts = without_dead_velocities(body, trajectories)
    usable, unusable = without_unusable_torques(body, moving)
    doubts += unusable
    if all(trajectory.unusable is not None and trajectory.unusable.all() for trajectory in usable):
        raise InputError(_names(trajectories), "no torque ever changes", "record the torques of the joints in N·m")
    return usable, doubts


def _refuse_contradicting(
    body: RigidBody, learnt: Sequence[Trajectory], judged: Sequence[Trajectory], doubts: Sequence[Doubt]
) -> None:
    """Raises InputError for recordings that others contradict: with what is wrong with them where that is told of
    them alone; otherwise what ``doubts`` say of all of them together is left to be told."""
    odd = contradicting(body, learnt, judged)
    if not odd:
        return
    alone = {number: [d for d in examine(body, [judged[number]], believed=True) if d.wrong] for number in odd}
    told = [number for number, found in alone.items() if found]
    all_alike = judged is learnt and len(told) == len(judged)
    if told and not all_alike:
        doubt = alone[told[0]][0]
        same = [judged[number] for number in told if alone[number][0].kind == doubt.kind]
        raise InputError(_names(same), doubt.problem, doubt.remedy)
    if any(doubt.wrong for doubt in doubts) and all_alike:
        return
    joints = ", ".join(dict.fromkeys(joint for found in odd.values() for joint in found))
    raise InputError(
        _names([judged[number] for number in odd]),
        f"what the other recordings say of the torque of {joints} is not what was recorded here",
        "check that all are of the same arm, in the same units and the same order of joints",
    )


def _names(trajectories: Sequence[Trajectory]) -> str:
    return ", ".join(Path(trajectory.name).name for trajectory in trajectories)


def examined_motion(body: RigidBody, trajectories: Sequence[Trajectory]) -> list[str]:
    """Of recordings whose torques are not read: a sentence for each thing that is doubtful about the motion.

    Raises InputError when its units are wrong beyond doubt.
    """
    for trajectory in trajectories:
        check_times(trajectory)
    doubts = examine_motion(body, trajectories)
    _refuse_what_is_wrong(body, doubts, trajectories)
    return [str(doubt) for doubt in doubts]


def _refuse_what_is_wrong(body: RigidBody, doubts: Sequence[Doubt], trajectories: Sequence[Trajectory]) -> None:
    for doubt in doubts:
        if doubt.wrong:
            raise InputError(_names(trajectories), doubt.problem, doubt.remedy + _where_held(body, doubt))


def _where_held(body: RigidBody, doubt: Doubt) -> str:
    """What else to check of links that did not move like this: the joints that nobody recorded."""
    if doubt.kind != "another arm" or not body.held:
        return ""
    held = ", ".join(f"{joint} = {value:g}" for joint, value in body.held.items())
    return f"; and that the joints without a column stood still there: {held} (--hold JOINT=VALUE)"
