"""From recordings to motions with a wrench on one time base and one clock: what the estimator of loads takes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from config import InputError, Installation
from driver.recording import Recording
from estimator.loads import LoadRecording, RigidLoad, Tare, align_wrench, tare
from estimator.plausibility import readable_wrench
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory
from service.identification.arm_source import ArmSource, arm_source, recorded_arm
from service.identification.continuous import continuous
from service.identification.examined import examined
from service.identification.recorded import Source, read_any, source_of, trajectory_of
from service.identification.request import LoadRequest

Array = NDArray[np.float64]
_NANOSECONDS = 1e9


@dataclass(frozen=True)
class LoadSources:
    """All recordings of a request, read in the order they were named, of one arm."""

    arm: ArmSource
    body: RigidBody
    frame: str
    recordings: tuple[Recording, ...]
    sources: tuple[Source, ...]
    notes: tuple[str, ...]

    @property
    def dated(self) -> bool:
        """Whether all recordings lie on one clock."""
        return all(r.start_ns > 0 for r in self.recordings)

    @property
    def sensor_range(self) -> Array | None:
        """(6,) N, N·m where the sensor saturates; None where that is not known."""
        for installation in (self.recordings[0].installation, self.arm.installation):
            if installation is not None and installation.wrench_sensor:
                sensor = installation.wrench_sensor[0]
                return np.array([sensor.range_n] * 3 + [sensor.range_nm] * 3)
        return None


def read_load_sources(request: LoadRequest, paths: Sequence[Path]) -> LoadSources:
    """Read them all. Raises InputError for a file that cannot be read, is of another arm, or has other joints."""
    arm = arm_source(request.arm) if request.arm is not None else None
    body: RigidBody | None = None
    read: list[Recording] = []
    notes: list[str] = []
    for path in paths:
        recording = read_any(path, arm, request.topic)
        if arm is None:
            arm = recorded_arm(recording, path)
        _of_the_same_arm(recording, path, arm)
        if body is None:
            body = arm.rigid_body(recording.joints, request.hold)
        elif missing := [joint for joint in body.joints if joint not in recording.joints]:
            raise InputError(
                str(path),
                f"lacks joint {', '.join(missing)}, which {paths[0].name} has",
                "give recordings of the same joints",
            )
        notes += [f"{path.name}: {note}" for note in recording.notes]
        if recording.wrench is not None and recording.wrench_t is not None:
            wrench, left_out = readable_wrench(path.name, recording.wrench_t, recording.wrench)
            recording = replace(recording, wrench=wrench)
            notes += left_out
        read.append(recording)
    assert arm is not None
    assert body is not None
    read, mended = continuous(read, body)
    notes += mended
    links = [f.name for f in body.model.frames][1:]
    told = read[0].wrench_frame if read[0].wrench_frame in links else None
    frame = request.frame or told or _configured_frame(arm, read[0].installation)
    if frame is None:
        raise InputError("--frame", f"the URDF does not say where the load is held ({', '.join(links)})", "name it")
    sources = tuple(source_of(path, recording) for path, recording in zip(paths, read, strict=True))
    return LoadSources(arm, body, frame, tuple(read), sources, tuple(notes))


def _of_the_same_arm(recording: Recording, path: Path, arm: ArmSource) -> None:
    if recording.arm is not None and arm.installation is not None and recording.arm != arm.name:
        raise InputError(
            str(path), f"is a recording of arm {recording.arm}, not of {arm.name}", "give recordings of one arm"
        )


def _configured_frame(arm: ArmSource, recorded: Installation | None) -> str | None:
    for installation in (recorded, arm.installation):
        if installation is not None:
            sensors = installation.wrench_sensor
            return sensors[0].frame if sensors else installation.arm.tool_frame
    return None


def motion_of(recording: Recording, body: RigidBody, name: str) -> Trajectory:
    """Its angles and velocities in the body's order of joints; torques, which a wrench makes needless, are zeros."""
    columns = body.columns(recording.joints)
    q = recording.q[:, columns]
    return Trajectory(
        t=recording.t,
        q=q,
        tau=np.zeros_like(q),
        dq=None if recording.dq is None else recording.dq[:, columns],
        name=name,
    )


def with_wrench(read: LoadSources, number: int) -> LoadRecording:
    """The recording of that number with its wrench. Raises InputError when it has none."""
    recording = read.recordings[number]
    name = read.sources[number].path
    if recording.wrench is None or recording.wrench_t is None:
        raise InputError(
            name, "has no wrench", "record the wrist sensor, or identify from joint torques: --without RECORDING"
        )
    aligned = align_wrench(motion_of(recording, read.body, name), recording.wrench_t, recording.wrench)
    if not read.dated:
        return aligned
    first = min(r.start_ns for r in read.recordings)
    return replace(aligned, session_start=(recording.start_ns - first) / _NANOSECONDS)


def with_torques(read: LoadSources, loaded: int) -> tuple[list[Trajectory], list[Trajectory], list[str]]:
    """The first ``loaded`` recordings and the free ones with their torques, examined; and what is doubtful about them.

    Raises InputError for a recording without torques, of joints that the others lack, or not of this arm in SI units.
    """
    known = read.recordings[0].joints
    trajectories = []
    for recording, source in zip(read.recordings, read.sources, strict=True):
        if strange := [joint for joint in recording.joints if joint not in known]:
            raise InputError(
                source.path,
                f"has joint {', '.join(strange)}, which {read.sources[0].path} lacks",
                "give loaded and free recordings of the same joints",
            )
        trajectories.append(trajectory_of(recording, read.body, source.path))
    with_load, doubts = examined(read.body, trajectories[:loaded])
    free, doubts_of_free = examined(read.body, trajectories[loaded:])
    return with_load, free, [*doubts, *(doubt for doubt in doubts_of_free if doubt not in doubts)]


def tare_of(read: LoadSources, number: int, hand: RigidLoad | None) -> Tare:
    """The sensor's offset by the rest of that recording. Raises InputError when the arm moves in it."""
    return tare(read.body, read.frame, with_wrench(read, number), hand)
