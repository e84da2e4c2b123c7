"""Finders: what answers a question of the campaign. The one of the house is asked as any user asks it."""

from __future__ import annotations

import json
import subprocess
import sys
import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any, Protocol

from benchmarks.campaign.sealing import Question
from estimator.diagnosis.diagnose import diagnose
from service.answers import finite
from service.diagnosis.json_answer import as_json
from service.diagnosis.usable import only_usable
from service.identification.read import read_recordings

TOPIC = "/joint_states"


class Finder(Protocol):
    """Reads the question's files and gives the answer of `etude diagnose --json`."""

    def __call__(self, question: Question) -> Mapping[str, Any]: ...


def in_process(question: Question) -> Mapping[str, Any]:
    """What `etude diagnose` does to find its answer, without its start-up, the twin's replay and the page."""
    read = read_recordings(
        question.learnt, question.held_out, str(question.urdf), {}, TOPIC, _silent,
        believed=True, drives_off=question.drives_off,
    )  # fmt: skip
    learning, judging = ([only_usable(read.body, t) for t in some] for some in (read.trajectories, read.hold_out))
    found = diagnose(read.body, learning, judging, drives_off=read.drives_off)
    answer: Mapping[str, Any] = finite(as_json(found, read.notes))
    return answer


def _silent(stage: str, share: float) -> None:
    """Nobody watches the progress."""


def by_command(question: Question) -> Mapping[str, Any]:
    """`etude diagnose` in a process of its own, which has seen nothing but the question."""
    with tempfile.TemporaryDirectory(prefix="etude-campaign-") as folder:
        answer = Path(folder) / "answer.json"
        hold_out = [word for path in question.held_out for word in ("--hold-out", str(path))]
        drives_off = [word for path in question.drives_off for word in ("--drives-off", str(path))]
        command = [sys.executable, "-m", "service", "diagnose", *map(str, question.learnt), *hold_out, *drives_off]
        command += ["--arm", str(question.urdf), "--json", str(answer)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if not answer.exists():
            raise RuntimeError(f"diagnose gave no answer (exit {run.returncode}): {run.stderr.strip()[-500:]}")
        found: Mapping[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
        return found
