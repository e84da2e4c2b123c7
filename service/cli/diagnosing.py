"""`diagnose`: what the simulation gets wrong, and why."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from config import InputError
from service.cli.asking import ControllerOption, ModeOption, conduct, motion_reference
from service.cli.console import progress, publish, say
from service.cli.options import (
    JOINT_STATES,
    ArmOption,
    AttachedOption,
    DrivesOffOption,
    HoldOption,
    HoldOutOption,
    JsonOption,
    MotionsOption,
    OutOption,
    TopicOption,
    keep_inputs,
    new_directory,
    refuse,
)
from service.identification.request import as_paths


def diagnose(
    recordings: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[RECORDING]...",
            help="Recordings (MCAP, CSV, text channels); motions that were played twice tell the noise.",
        ),
    ] = None,
    hold_out: HoldOutOption = None,
    drives_off: DrivesOffOption = None,
    arm: ArmOption = None,
    hold: HoldOption = None,
    topic: TopicOption = JOINT_STATES,
    tolerance: Annotated[
        float, typer.Option("--tolerance", metavar="SHARE", help="How exactly the model's link parameters are known.")
    ] = 0.05,
    experiment: Annotated[
        bool,
        typer.Option("--experiment", help="Play what decides on the arm; without recordings its own motions first."),
    ] = False,
    budget: Annotated[
        int | None,
        typer.Option(
            "--budget",
            metavar="N",
            min=0,
            max=20,
            help="Deciding motions to play at most; a reading with the drives off may come besides. [2]",
        ),
    ] = None,
    motion: MotionsOption = None,
    track: Annotated[
        str | None,
        typer.Option(
            "--track", metavar="MOTION", help="At last, play it under the given and the found model's feedforward."
        ),
    ] = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    attached: AttachedOption = False,
    out: OutOption = None,
    json: JsonOption = None,
) -> None:
    """Name what the arm's model gets wrong, from recordings or by experiment."""
    keep_inputs(json, recordings, hold_out, drives_off)
    if experiment:
        unfit = (("--hold", hold), ("--out", out), ("--topic", topic != JOINT_STATES))
        refuse(unfit, "is for diagnosing from recordings alone", "leave it out, or --experiment")
        answer = conduct(
            arm,
            "diagnose",
            {
                "recordings": [str(path) for path in as_paths(recordings or [])],
                "hold_out": [str(path) for path in as_paths(hold_out or [])],
                "drives_off": [str(path) for path in as_paths(drives_off or [])],
                "motions": [motion_reference(m) for m in motion or []],
                "track": None if track is None else motion_reference(track),
                "budget": 2 if budget is None else budget,
                "tolerance": tolerance,
                "mode": mode,
                "controller": controller,
                "attached": attached,
            },
        )
    else:
        beside = (("--budget", budget is not None), ("--motion", motion), ("--track", track), ("--attached", attached))
        refuse(beside, "is for diagnosing by experiment", "add --experiment")
        if not recordings:
            raise InputError(
                "recordings",
                "there are none",
                "give at least one, better two playings of each motion; or --experiment, and the arm moves itself",
            )
        answer = _from_recordings(recordings, hold_out or [], drives_off or [], arm, hold or [], topic, tolerance, out)
    from service.reports.diagnosis_tables import diagnosis_report

    for note in answer["notes"]:
        say(f"etude: {note}")
    publish(answer, json, *diagnosis_report(answer))


def _from_recordings(
    recordings: list[str],
    hold_out: list[str],
    drives_off: list[str],
    arm: str | None,
    hold: list[str],
    topic: str,
    tolerance: float,
    out: Path | None,
) -> dict[str, Any]:
    from service.diagnosis.diagnosing import diagnose_recordings
    from service.diagnosis.request import DiagnoseRequest
    from service.identification.arm_source import parse_holds

    request = DiagnoseRequest(
        recordings=as_paths(recordings),
        hold_out=as_paths(hold_out),
        drives_off=as_paths(drives_off),
        arm=arm,
        hold=parse_holds(hold),
        topic=topic,
        tolerance=tolerance,
        directory=out.absolute() if out else new_directory("diagnosis"),
    )
    with progress() as tell:
        return diagnose_recordings(request, tell).answer
