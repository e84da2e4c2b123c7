"""Recordings examined before anything is fitted to them: what cannot be this arm's in SI units is refused."""

from __future__ import annotations

from collections.abc import Sequence
from pathlib import Path

from config import InputError
from estimator.plausibility import Doubt, examine, examine_motion, without_unusable_torques
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
    usable, doubts = without_unusable_torques(body, trajectories)
    if all(trajectory.unusable is not None and trajectory.unusable.all() for trajectory in usable):
        names = ", ".join(Path(trajectory.name).name for trajectory in trajectories)
        raise InputError(names, "no torque ever changes", "record the torques of the joints in N·m")
    doubts += examine(body, usable, believed)
    _refuse_what_is_wrong(doubts, trajectories)
    return usable, [str(doubt) for doubt in doubts]


def examined_motion(body: RigidBody, trajectories: Sequence[Trajectory]) -> list[str]:
    """Of recordings whose torques are not read: a sentence for each thing that is doubtful about the motion.

    Raises InputError when its units are wrong beyond doubt.
    """
    doubts = examine_motion(body, trajectories)
    _refuse_what_is_wrong(doubts, trajectories)
    return [str(doubt) for doubt in doubts]


def _refuse_what_is_wrong(doubts: Sequence[Doubt], trajectories: Sequence[Trajectory]) -> None:
    for doubt in doubts:
        if doubt.wrong:
            names = ", ".join(Path(trajectory.name).name for trajectory in trajectories)
            raise InputError(names, doubt.problem, doubt.remedy)
