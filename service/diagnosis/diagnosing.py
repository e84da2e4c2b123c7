"""Diagnose recordings: read, judge, answer. The same function serves the command line and a worker process."""

from __future__ import annotations

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.arm_model import ArmModel, diagnosed_model
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.drives import with_drives
from estimator.diagnosis.gears import with_gears
from estimator.diagnosis.telling.answer import Diagnosis
from estimator.plausibility import missing_motions
from service.diagnosis.experimenting import next_experiment, realised_gap
from service.diagnosis.json_answer import as_json
from service.diagnosis.keeping import keep
from service.diagnosis.request import DiagnoseRequest
from service.diagnosis.simulating import replay_both
from service.diagnosis.usable import only_usable
from service.identification.read import ReadRecordings, read_recordings
from service.models.model_file import model_file, write_model
from service.models.store import keep_model, next_version

Array = NDArray[np.float64]
Tell = Callable[[str, float], None]
MODEL = "model.toml"


@dataclass(frozen=True)
class DiagnosisOutcome:
    """A diagnosis with what it was made from."""

    read: ReadRecordings
    result: Diagnosis
    answer: dict[str, Any]


def diagnose_recordings(request: DiagnoseRequest, tell: Tell = lambda stage, share: None) -> DiagnosisOutcome:
    """Reads, judges, and keeps what was found where the request says so.

    Raises InputError naming file, line and column for recordings that cannot be used.
    """
    if not 0.0 < request.tolerance < 1.0:
        raise InputError("--tolerance", f"{request.tolerance:g} is no share", "give for instance 0.05 for 5 %")
    read = read_recordings(
        request.recordings,
        request.hold_out,
        request.arm,
        request.hold,
        request.topic,
        tell,
        believed=True,
        drives_off=request.drives_off,
    )
    missing = missing_motions(read.body, read.trajectories)
    tell("judging", 0.4)
    result = _diagnosed(read, request.tolerance)
    answer = {
        "arm": read.arm.name,
        "recordings": [str(path) for path in request.recordings],
        "hold_out": [str(path) for path in request.hold_out],
        "drives_off": [trajectory.name for trajectory in read.drives_off],
        **as_json(result, [*read.notes, *missing]),
        "model_name": None,
        "report": None,
    }
    answer["experiments"] = [_played(one, result) for one in request.experiments]
    if any(finding.contest is not None for finding in result.findings):
        tell("designing what would decide", 0.7)
    for number, (finding, told) in enumerate(zip(result.findings, answer["findings"], strict=True), 1):
        name = f"experiment-{len(request.experiments) + 1}-{number}"
        told["next_experiment"] = next_experiment(result, finding, read, request.directory, name)
    if result.findings:
        tell("simulating", 0.8)
        extended = diagnosed_model(read.body, result)
        answer["gain"]["simulation"] = _simulated(ArmModel(read.body), extended, read, answer["notes"])
        if request.directory is not None:
            answer |= _kept_model(request.directory, extended, result, read)
    if request.directory is not None:
        tell("drawing the page", 0.9)
        answer = keep(request.directory, result, answer)
    tell("done", 1.0)
    return DiagnosisOutcome(read, result, answer)


def _diagnosed(read: ReadRecordings, tolerance: float) -> Diagnosis:
    """The arm; its drives where every recording to learn from has the torques of motors and sensors, and its gears
    where every one has the angles on both sides."""
    learning, judging = ([only_usable(read.body, t) for t in some] for some in (read.trajectories, read.hold_out))
    result = diagnose(read.body, learning, judging, tolerance, read.drives_off)
    warm = [trajectory.temperature is not None for trajectory in (*learning, *judging)]
    if any(warm) and not all(warm):
        result = _not_in_all(result, "temperature", "temperature")
    learnt = list(zip(read.trajectories, read.recordings, strict=False))
    motors = [
        replace(trajectory, tau=recording.tau_motor[:, read.body.columns(recording.joints)], unusable=None)
        for trajectory, recording in learnt
        if recording.tau_motor is not None
    ]
    if len(motors) == len(learnt):
        result = with_drives(result, read.body, motors, read.trajectories)
    elif motors:
        result = _not_in_all(result, "tau_motor", "drive")
    angles = [
        recording.q_motor[:, read.body.columns(recording.joints)]
        for _, recording in learnt
        if recording.q_motor is not None
    ]
    if len(angles) == len(learnt):
        result = with_gears(result, read.body, read.trajectories, angles)
    elif angles:
        result = _not_in_all(result, "q_motor", "gear")
    return result


def _not_in_all(found: Diagnosis, columns: str, place: str) -> Diagnosis:
    note = f"not every recording has the columns {columns}_<joint>: no {place} is judged"
    return replace(found, notes=(*found.notes, note))


def _played(experiment: Mapping[str, Any], result: Diagnosis) -> dict[str, Any]:
    """A motion that was played to decide, with what it decided."""
    return {"gap": realised_gap(result, experiment["between"]), **experiment}


def _kept_model(directory: Path, extended: ArmModel, result: Diagnosis, read: ReadRecordings) -> dict[str, Any]:
    """The extended model as the arm's next version, and the same file beside the answer."""
    arm = read.arm.name
    file = model_file(arm, extended, result.verdict, read.sources, next_version(arm))
    keep_model(file)
    write_model(directory / MODEL, file)
    return {"model": str(directory / MODEL), "model_name": f"{arm}@{file.version}"}


def _simulated(given: ArmModel, extended: ArmModel, read: ReadRecordings, notes: list[str]) -> dict[str, Any]:
    """Of what was held out, where there is some. A model that MuJoCo cannot simulate is a note, not an end."""
    learnt = len(read.trajectories)
    trajectories = read.hold_out or read.trajectories
    recordings = read.recordings[learnt:] if read.hold_out else read.recordings[:learnt]
    replayed = replay_both(given, extended, recordings, trajectories)
    notes += replayed.notes
    return {
        "position_before_rms": _rms(replayed.before),
        "position_after_rms": _rms(replayed.after),
        "joints": {
            joint: {"before_rms": _of(replayed.before, k), "after_rms": _of(replayed.after, k)}
            for k, joint in enumerate(read.body.joints)
        },
        "unit": ", ".join(dict.fromkeys("rad" if axis.revolute else "m" for axis in read.body.axes)),
        "controller": replayed.controller,
        "seconds": replayed.seconds,
    }


def _rms(joints: Array | None) -> float | None:
    return None if joints is None else float(np.sqrt(np.mean(joints**2)))


def _of(joints: Array | None, k: int) -> float | None:
    return None if joints is None else float(joints[k])
