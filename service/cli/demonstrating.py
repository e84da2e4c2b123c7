"""The command `demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from service.cli.options import JsonOption


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where everything goes.")] = Path("etude-demo"),
    realtime: Annotated[bool, typer.Option("--realtime", help="In wall-clock time, in place of lockstep.")] = False,
    json: JsonOption = None,
) -> None:
    """The whole story on the stand-in arm: move it over the bus, record, identify, compare with the thesis' tables."""
    from service.cli.console import publish
    from service.demo.story import tell_story

    answer, shown = tell_story(out.absolute(), lockstep=not realtime)
    publish(answer, json, *shown)
