"""All recordings that a command names, with the arm that they are of, as the estimator takes them."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config import InputError
from driver.recording import Recording
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory
from service.identification.arm_source import ArmSource, arm_source, recorded_arm
from service.identification.continuous import continuous
from service.identification.examined import examined, examined_beside
from service.identification.recorded import DRIVES_OFF, Source, read_any, source_of, trajectory_of

Tell = Callable[[str, float], None]
_HELD = 0.05
"""rad (m): what a joint that is held may stand away from where it is said to."""


@dataclass(frozen=True)
class ReadRecordings:
    """What was read: of the arm whose ``body`` all recordings are."""

    body: RigidBody
    arm: ArmSource
    sources: tuple[Source, ...]
    """Of the recordings that are learnt from."""
    trajectories: tuple[Trajectory, ...]
    hold_out: tuple[Trajectory, ...]
    notes: tuple[str, ...]
    recordings: tuple[Recording, ...]
    """What the trajectories were taken from: those to learn from, then those held out."""
    drives_off: tuple[Trajectory, ...] = ()
    """At rest, with the drives off: what their torques read is no torque of the arm."""


def read_recordings(
    recordings: Sequence[Path],
    hold_out: Sequence[Path],
    arm_named: str | None,
    hold: Mapping[str, float],
    topic: str,
    tell: Tell,
    believed: bool = False,
    drives_off: Sequence[Path] = (),
) -> ReadRecordings:
    """Reads everything, the recordings to judge on behind those to learn from. Those that say that they were made with
    the drives off are taken with ``drives_off``.

    ``arm_named``: a configured name, an installation or URDF file, or None for the arm that the recordings carry.
    ``believed``: its masses are the model that is to be judged, and no first guess.
    Raises InputError naming file, line and column for recordings that cannot be used, or what is wrong with channels
    that cannot be this arm's (`estimator.plausibility`).
    """
    paths = [*recordings, *hold_out, *drives_off]
    if not recordings:
        raise InputError("recordings", "there are none", "give at least one")
    arm = arm_source(arm_named) if arm_named is not None else None
    body: RigidBody | None = None
    sources: list[Source] = []
    whole: list[Recording] = []
    off: list[bool] = []
    notes: list[str] = []
    for k, path in enumerate(paths):
        tell(f"reading {path.name}", 0.35 * k / len(paths))
        recording = read_any(path, arm, topic)
        if arm is None:
            arm = recorded_arm(recording, path)
        if body is None:
            body = arm.rigid_body(recording.joints, hold)
        _same_joints(path, recording, paths[0], body, arm, hold)
        _held_still(path, recording, hold)
        notes += [f"{path.name}: {note}" for note in recording.notes]
        sources.append(source_of(path, recording))
        _once(path, sources, len(recordings))
        whole.append(recording)
        says_so = DRIVES_OFF.items() <= recording.metadata.items()
        off.append(says_so or k >= len(recordings) + len(hold_out))
        if says_so:
            notes.append(f"{path.name}: recorded with the drives off, and no motion")
    assert arm is not None
    assert body is not None
    whole, mended = continuous(whole, body)
    notes += mended
    read = [trajectory_of(recording, body, str(path)) for recording, path in zip(whole, paths, strict=True)]
    if body.held:
        held = ", ".join(f"{name} = {value:g}" for name, value in body.held.items())
        notes.append(f"joints of the URDF that were not recorded are held still: {held}")
    tell("examining the recordings", 0.35)
    moving = [k for k in range(len(paths)) if not off[k]]
    learning = [k for k in moving if k < len(recordings)]
    if not learning:
        raise InputError(str(paths[0]), "was recorded with the drives off", "give recordings of motions as well")
    learnt, doubts = examined(body, [read[k] for k in learning], believed)
    held_out = [read[k] for k in moving if k >= len(recordings)]
    judged, doubts_of_judged = examined_beside(body, learnt, held_out) if believed else examined(body, held_out)
    notes += [*doubts, *doubts_of_judged]
    return ReadRecordings(
        body,
        arm,
        tuple(sources[k] for k in learning),
        tuple(learnt),
        tuple(judged),
        tuple(notes),
        tuple(whole[k] for k in moving),
        tuple(trajectory for trajectory, is_off in zip(read, off, strict=True) if is_off),
    )


def _same_joints(
    path: Path, recording: Recording, first: Path, body: RigidBody, arm: ArmSource, hold: Mapping[str, float]
) -> None:
    """Raises InputError for a recording of more joints than the first, of a URDF that does not say which are the arm's:
    what moves there is not taken as held."""
    more = [joint for joint in recording.joints if joint not in body.joints and joint not in hold]
    if arm.joints is None and more:
        problem = f"has {', '.join(more)}, which {first.name} has not"
        raise InputError(str(path), problem, "give recordings of the same joints together")


def _held_still(path: Path, recording: Recording, hold: Mapping[str, float]) -> None:
    """Raises InputError where a joint was recorded elsewhere than it is said to be held."""
    for joint, value in hold.items():
        if joint not in recording.joints:
            continue
        away = float(np.nanmax(np.abs(recording.q[:, recording.joints.index(joint)] - value), initial=0.0))
        if away > _HELD:
            problem = f"{joint} is in {path.name}, up to {away:.3g} away from there"
            raise InputError(f"--hold {joint}={value:g}", problem, "leave it out, or say where it stood")


def _once(path: Path, sources: Sequence[Source], learnt: int) -> None:
    """Raises InputError where the last of the sources holds what one before it does: told twice, a recording's noise
    would be a law of the arm."""
    *before, last = sources
    same = next((k for k, other in enumerate(before) if other.sha256 == last.sha256), None)
    if same is None:
        return
    if same < learnt <= len(before):
        raise InputError(str(path), "is both learnt from and held out", "hold out a recording of its own")
    raise InputError(str(path), f"is the same recording as {before[same].path}", "give each recording once")
