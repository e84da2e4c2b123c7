"""Commands that calibrate: `calibrate torque-constant`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from config import InputError
from service import outcomes
from service.cli.asking import ControllerOption, ModeOption, conduct, motion_reference
from service.cli.console import progress, publish, say
from service.cli.options import (
    ArmOption,
    AttachedOption,
    BandOption,
    FrameOption,
    JsonOption,
    MotionsOption,
    Names,
    refuse,
)
from service.identification.request import TorqueConstantRequest, as_paths

app = typer.Typer(help="Calibrate what the arm measures.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def calibrate() -> None:
    """Calibrate what the arm measures."""


@app.command("torque-constant")
def torque_constant(
    loaded: Annotated[
        Names,
        typer.Argument(metavar="[LOADED]...", help="Recordings with a load and its wrench. None: the arm moves."),
    ] = None,
    without: Annotated[
        Names,
        typer.Option("--without", metavar="FREE", help="The same motion without the load; repeat. None: record it."),
    ] = None,
    arm: ArmOption = None,
    frame: FrameOption = None,
    band_hz: BandOption = None,
    motion: MotionsOption = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    attached: AttachedOption = False,
    json: JsonOption = None,
) -> None:
    """True over measured torque of each joint, by a load that the wrist sensor weighs.

    By moving the arm: first without a load, then with one, --without what was recorded first. Exit code 1: the load
    reaches no joint well enough.
    """
    if loaded:
        refuse((("--motion", motion), ("--attached", attached)), "is for calibrating by moving the arm", "leave it out")
        answer = _from_recordings(loaded, without or [], arm, frame, band_hz)
    else:
        refuse((("--frame", frame),), "is for calibrating from recordings", "leave it out")
        asked = {
            "without": [str(path) for path in as_paths(without or [])],
            "motions": [motion_reference(m) for m in motion or []],
            "band_hz": band_hz,
            "mode": mode,
            "controller": controller,
            "attached": attached,
        }
        answer = conduct(arm, "calibrate_torque_constant", asked)
    from service.reports.torque_constant_table import torque_constant_report

    for note in [*answer["notes"], *answer["warnings"]]:
        say(f"etude: {note}")
    publish(answer, json, *torque_constant_report(answer))
    if answer["joints"] is not None and answer["status"] != "calibrated":
        raise typer.Exit(outcomes.ANSWER_IS_NO)


def _from_recordings(
    loaded: list[str], without: list[str], arm: str | None, frame: str | None, band_hz: float | None
) -> dict[str, Any]:
    from service.identification.torque_constant import calibrate as calibrate_from

    if not without:
        raise InputError("--without", "is missing", "give recordings of the same motion without the load")
    request = TorqueConstantRequest(
        as_paths(loaded), Path(), without=as_paths(without), arm=arm, frame=frame, band_hz=band_hz
    )
    with progress() as tell:
        return calibrate_from(request, tell)
