"""What the user sees: answers on standard output, progress and warnings on standard error."""

from __future__ import annotations

import json
import sys
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Any, Protocol

from rich.console import Console, RenderableType
from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

from config import InputError
from service.answers import finite
from service.sessions.store import write_atomically

STDOUT = "-"
WIDTH = 180
"""Columns of what is written into a file or a pipe."""


def say(sentence: str) -> None:
    """One line for a person, on standard error, never wrapped or coloured."""
    print(sentence, file=sys.stderr, flush=True)


def publish(answer: Mapping[str, Any], json_to: str | None, *shown: RenderableType) -> None:
    """Give a command's answer: as JSON where ``--json`` says, and ``shown`` on standard output for a person.

    With ``--json -`` standard output carries the JSON alone. Raises InputError when the file cannot be written.
    """
    if json_to is not None:
        _write_json(answer, json_to, indent=1)
        if json_to == STDOUT:
            return
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else WIDTH)
    for item in shown:
        console.print(item)


def announce(answer: Mapping[str, Any], json_to: str | None) -> None:
    """Give the answer of a command that is ready and goes on serving: one line where ``--json`` says, at once.

    Raises InputError when the file cannot be written.
    """
    if json_to is not None:
        _write_json(answer, json_to, indent=None)


def _write_json(answer: Mapping[str, Any], json_to: str, indent: int | None) -> None:
    text = json.dumps(finite(answer), indent=indent, allow_nan=False, ensure_ascii=False)
    if json_to == STDOUT:
        print(text, flush=True)  # a pipe is read while the command goes on
        return
    try:
        write_atomically(Path(json_to), text + "\n")
    except OSError as error:
        raise InputError(json_to, f"the answer cannot be written here ({error.strerror})") from None


class ProgressSink(Protocol):
    """Takes news of long work: the stage in words, and the share of the whole that is done."""

    def __call__(self, stage: str, share: float) -> None: ...


@contextmanager
def progress() -> Iterator[ProgressSink]:
    """A bar on standard error when that is a terminal; one line a stage when it is not."""
    console = Console(stderr=True)
    if not console.is_terminal:
        told = ""

        def tell(stage: str, share: float) -> None:
            nonlocal told
            if stage != told:
                told = stage
                say(stage)

        yield tell
        return
    columns = (
        TextColumn("{task.description}", markup=False),
        BarColumn(),
        TextColumn("{task.percentage:3.0f} %", markup=False),
        TimeElapsedColumn(),
    )
    with Progress(*columns, console=console, transient=True) as bar:
        task = bar.add_task("", total=1.0)
        yield lambda stage, share: bar.update(task, description=stage, completed=share)
