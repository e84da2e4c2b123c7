"""The command `demo`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config import InputError
from config.loader import installation_path
from service.cli.options import JsonOption


def demo(
    out: Annotated[Path, typer.Option("--out", metavar="DIR", help="Where everything goes.")] = Path("etude-demo"),
    realtime: Annotated[bool, typer.Option("--realtime", help="In wall-clock time, in place of lockstep.")] = False,
    arm: Annotated[
        str | None, typer.Option("--arm", metavar="NAME", help="dda, the arm of the thesis' tables, and no other.")
    ] = None,
    json: JsonOption = None,
) -> None:
    """The whole story on the stand-in arm: move it over the bus, record, identify, compare with the thesis' tables."""
    from service.cli.console import publish
    from service.demo.story import ARM, tell_story

    if arm and installation_path(arm).resolve() != installation_path(ARM).resolve():
        raise InputError(
            f"--arm {arm}",
            f"the demo compares with the thesis' tables, which are of the {ARM} stand-in alone",
            f"bring the arm up with etude up --virtual --arm {arm}, then etude identify links",
        )
    answer, shown = tell_story(out.absolute(), lockstep=not realtime)
    publish(answer, json, *shown)
