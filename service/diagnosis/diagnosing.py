"""Diagnose recordings: read, judge, answer. The same function serves the command line and a worker process."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Any

from config import InputError
from estimator.diagnosis.answer import Diagnosis
from estimator.diagnosis.diagnose import diagnose
from service.diagnosis.json_answer import as_json
from service.diagnosis.keeping import keep
from service.diagnosis.request import DiagnoseRequest
from service.identification.read import ReadRecordings, read_recordings

Tell = Callable[[str, float], None]


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
    read = read_recordings(request.recordings, request.hold_out, request.arm, request.hold, request.topic, tell)
    tell("judging", 0.4)
    result = diagnose(read.body, read.trajectories, read.hold_out, request.tolerance)
    answer = {
        "arm": read.arm.name,
        "recordings": [str(path) for path in request.recordings],
        "hold_out": [str(path) for path in request.hold_out],
        **as_json(result, read.notes),
        "report": None,
    }
    if request.directory is not None:
        tell("drawing the page", 0.9)
        answer = keep(request.directory, result, answer)
    tell("done", 1.0)
    return DiagnosisOutcome(read, result, answer)
