"""Which page belongs to an answer, told by what the answer holds."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

from config import InputError
from service.diagnosis.keeping import ANSWER, PAGE, kept_page
from service.reports.links_page import links_page
from service.reports.load_page import load_page
from service.reports.page import write_page
from service.reports.practice_page import controllers_page, practice_page
from service.reports.task_plot import task_page

__all__ = ["page_of", "page_of_file"]


def page_of(answer: dict[str, Any], directory: Path) -> str | None:
    """The page of a command's JSON answer that was kept in ``directory``; None for an answer that has no page.

    Raises InputError for an answer that another version of Étude wrote, whose keys are not today's.
    """
    try:
        return _page(answer, directory)
    except (AttributeError, KeyError, TypeError) as error:
        raise InputError(
            str(directory),
            f"holds an answer as this version does not write it ({type(error).__name__}: {error})",
            "ask again with the recordings that it names, and make the page of the new answer",
        ) from error


def _page(answer: dict[str, Any], directory: Path) -> str | None:
    if "verdict" in answer and "findings" in answer:
        # A session keeps the answer; its diagnosis, with the traces, lies in a directory of its own.
        return kept_page(answer, Path(answer["report"]).parent if answer.get("session") else directory)
    if "base_parameters" in answer:
        return links_page(answer)
    if "principal_moments" in answer:
        return load_page(answer)
    if "repeatability" in answer and "plot" in answer:
        return practice_page(answer)
    if "task" in answer and "trials" in answer:
        return task_page(answer)
    if "controllers" in answer:
        return controllers_page(answer)
    return None


def page_of_file(path: Path) -> Path:
    """Make the page of a kept answer, a JSON file or the directory of a diagnosis, beside it; returns its path.

    Raises InputError when the file is no answer that has a page.
    """
    answer_path = path / ANSWER if path.is_dir() else path
    try:
        answer = json.loads(answer_path.read_text(encoding="utf-8"))
    except OSError as error:
        raise InputError(str(answer_path), f"cannot be read ({error.strerror})", "name an answer in JSON") from None
    except ValueError as error:
        raise InputError(str(answer_path), f"is not JSON ({error})", "name what --json wrote") from None
    text = page_of(answer, answer_path.parent) if isinstance(answer, dict) else None
    if text is None:
        raise InputError(
            str(answer_path), "is no answer that has a page", "name the answer of diagnose, identify or practise"
        )
    page = answer_path.parent / PAGE if answer_path.name == ANSWER else answer_path.with_suffix(".html")
    write_page(page, text)
    return page
