"""What a diagnosis leaves: its answer, the traces that its pictures are drawn from, the page."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from config import InputError
from estimator.diagnosis.telling.answer import Diagnosis
from service.answers import finite
from service.diagnosis.traces_file import TRACES, load_traces, save_traces
from service.reports.diagnosis_page import diagnosis_page
from service.reports.page import write_page
from service.sessions.store import write_atomically

ANSWER, PAGE = "diagnosis.json", "report.html"


def keep(directory: Path, result: Diagnosis, answer: dict[str, Any]) -> dict[str, Any]:
    """Write all three into ``directory``; returns the answer with the page's place in it.

    Raises InputError when the directory cannot be made or written.
    """
    try:
        directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(directory), f"cannot be made ({error.strerror})", "choose another --out") from None
    save_traces(directory / TRACES, result.traces)
    answer = {**answer, "report": str(directory / PAGE)}
    keep_answer(directory, answer)
    return answer


def keep_answer(directory: Path, answer: dict[str, Any]) -> None:
    """Write an answer and its page, beside the traces that are there. Raises InputError when they cannot be written."""
    try:
        write_atomically(directory / ANSWER, json.dumps(finite(answer), indent=1, ensure_ascii=False) + "\n")
    except OSError as error:
        raise InputError(str(directory), f"cannot be written ({error.strerror})", "choose another --out") from None
    write_page(directory / PAGE, kept_page(answer, directory))


def kept_page(answer: dict[str, Any], directory: Path) -> str:
    """The page of an answer, with the pictures of the traces beside it where they still are."""
    path = directory / TRACES
    return diagnosis_page(finite(answer), load_traces(path) if path.is_file() else None)
