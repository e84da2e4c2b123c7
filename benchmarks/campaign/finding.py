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
from service.answers import finite
from service.diagnosis.diagnosing import diagnose_recordings
from service.diagnosis.request import DiagnoseRequest


class Finder(Protocol):
    """Reads the question's files and gives the answer of `etude diagnose --json`."""

    def __call__(self, question: Question) -> Mapping[str, Any]: ...


def in_process(question: Question) -> Mapping[str, Any]:
    """What `etude diagnose` does, without its start-up: the function behind it, which takes paths alone."""
    request = DiagnoseRequest(question.learnt, question.held_out, arm=str(question.urdf))
    answer: Mapping[str, Any] = finite(diagnose_recordings(request).answer)
    return answer


def by_command(question: Question) -> Mapping[str, Any]:
    """`etude diagnose` in a process of its own, which has seen nothing but the question."""
    with tempfile.TemporaryDirectory(prefix="etude-campaign-") as folder:
        answer = Path(folder) / "answer.json"
        hold_out = [word for path in question.held_out for word in ("--hold-out", str(path))]
        command = [sys.executable, "-m", "service", "diagnose", *map(str, question.learnt), *hold_out]
        command += ["--arm", str(question.urdf), "--json", str(answer)]
        run = subprocess.run(command, capture_output=True, text=True, check=False)
        if not answer.exists():
            raise RuntimeError(f"diagnose gave no answer (exit {run.returncode}): {run.stderr.strip()[-500:]}")
        found: Mapping[str, Any] = json.loads(answer.read_text(encoding="utf-8"))
        return found
