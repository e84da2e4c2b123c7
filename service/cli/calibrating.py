"""Commands that calibrate: `calibrate torque-constant`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer
from rich.table import Table

from service import outcomes
from service.answers import finite
from service.cli.console import progress, publish, say
from service.cli.options import ArmOption, BandOption, FrameOption, JsonOption
from service.identification.request import LoadRequest, as_paths

app = typer.Typer(help="Calibrate what the arm measures.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def calibrate() -> None:
    """Calibrate what the arm measures."""


@app.command("torque-constant")
def torque_constant(
    loaded: Annotated[list[str], typer.Argument(metavar="LOADED...", help="Recordings with a load and its wrench.")],
    without: Annotated[
        list[str], typer.Option("--without", metavar="FREE", help="The same motion without the load; repeat.")
    ],
    arm: ArmOption = None,
    frame: FrameOption = None,
    band_hz: BandOption = None,
    json: JsonOption = None,
) -> None:
    """True over measured torque of each joint, by a load that the wrist sensor weighs.

    Exit code 1: the load reaches no joint well enough.
    """
    from service.identification.torque_constant import calibrate as calibrate_from
    from service.reports.link_tables import figure

    request = LoadRequest(as_paths(loaded), Path(), without=as_paths(without), arm=arm, frame=frame, band_hz=band_hz)
    with progress() as tell:
        answer = calibrate_from(request, tell)
    for note in [*answer["notes"], *answer["warnings"]]:
        say(f"etude: {note}")
    table = Table(
        "joint", "true / measured", "± std. error", "rated_torque_nm", "± std. error", "load [N·m rms]", box=None
    )
    for joint, found in answer["joints"].items():
        numbers = (found[key][part] for key in ("gain", "rated_torque_nm") for part in ("value", "standard_error"))
        table.add_row(joint, *(figure(finite(x)) for x in numbers), figure(found["load_torque_rms"]))
    publish(answer, json, f"arm {answer['arm']}: {answer['status']}", table)
    if answer["status"] != "calibrated":
        raise typer.Exit(outcomes.ANSWER_IS_NO)
