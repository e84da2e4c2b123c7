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
        text = json.dumps(finite(answer), indent=1, allow_nan=False, ensure_ascii=False)
        if json_to == STDOUT:
            print(text)
            return
        try:
            write_atomically(Path(json_to), text + "\n")
        except OSError as error:
            raise InputError(json_to, f"the answer cannot be written here ({error.strerror})") from None
    console = Console(highlight=False, markup=False, width=None if sys.stdout.isatty() else WIDTH)
    for item in shown:
        console.print(item)


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
