"""`diagnose`: what the simulation gets wrong, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated

import typer

from config import InputError
from service.cli.console import progress, publish, say
from service.cli.options import ArmOption, JsonOption, new_directory
from service.identification.request import as_paths


def diagnose(
    recordings: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[RECORDING]...",
            help="Recordings (MCAP, CSV, text channels); motions that were played twice tell the noise.",
        ),
    ] = None,
    hold_out: Annotated[
        list[str] | None, typer.Option("--hold-out", metavar="RECORDING", help="Judge on this one; repeat for several.")
    ] = None,
    arm: ArmOption = None,
    hold: Annotated[
        list[str] | None,
        typer.Option(
            "--hold", metavar="JOINT=VALUE", help="A joint of the URDF that stands still; repeat for several."
        ),
    ] = None,
    topic: Annotated[str, typer.Option("--topic", help="JointState topic of a foreign MCAP.")] = "/joint_states",
    tolerance: Annotated[
        float, typer.Option("--tolerance", metavar="SHARE", help="How exactly the model's link parameters are known.")
    ] = 0.05,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where answer and page go. [the state directory]")
    ] = None,
    json: JsonOption = None,
) -> None:
    """Name what the arm's model gets wrong, from recordings."""
    if not recordings:
        raise InputError("recordings", "there are none", "give at least one, better two playings of each motion")
    from service.diagnosis.diagnosing import diagnose_recordings
    from service.diagnosis.request import DiagnoseRequest
    from service.identification.arm_source import parse_holds
    from service.reports.diagnosis_tables import diagnosis_report

    request = DiagnoseRequest(
        recordings=as_paths(recordings),
        hold_out=as_paths(hold_out or []),
        arm=arm,
        hold=parse_holds(hold or []),
        topic=topic,
        tolerance=tolerance,
        directory=out.absolute() if out else new_directory("diagnosis"),
    )
    with progress() as tell:
        answer = diagnose_recordings(request, tell).answer
    for note in answer["notes"]:
        say(f"etude: {note}")
    publish(answer, json, *diagnosis_report(answer))
