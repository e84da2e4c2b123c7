"""Commands that identify: `identify links`."""

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
    BandOption,
    HoldOption,
    HoldOutOption,
    JsonOption,
    MotionsOption,
    OutOption,
    TopicOption,
    installation_of,
    keep_inputs,
    new_directory,
    refuse,
)
from service.identification.request import EstimatorName, LinksRequest, as_paths

app = typer.Typer(help="Identify inertial parameters.", no_args_is_help=True, rich_markup_mode=None)


@app.callback()
def identify() -> None:
    """Identify inertial parameters."""


EstimatorOption = Annotated[
    EstimatorName,
    typer.Option("--estimator", help="How the equations are weighted."),
]


@app.command("links")
def links(
    recordings: Annotated[
        list[str] | None,
        typer.Argument(
            metavar="[RECORDING]...", help="Recordings (MCAP, CSV, text channels). None: the arm moves itself."
        ),
    ] = None,
    hold_out: HoldOutOption = None,
    arm: ArmOption = None,
    hold: HoldOption = None,
    topic: TopicOption = JOINT_STATES,
    motion: MotionsOption = None,
    design: Annotated[
        bool, typer.Option("--design", help="Design the motion that tells the most, and play it in place of a list.")
    ] = False,
    estimator: EstimatorOption = "optimal_filter",
    band_hz: BandOption = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    attached: AttachedOption = False,
    out: OutOption = None,
    json: JsonOption = None,
) -> None:
    """Identify the links, from recordings or by moving the arm."""
    keep_inputs(json, recordings, hold_out)
    if recordings:
        moving = (("--motion", motion), ("--design", design), ("--attached", attached))
        refuse(moving, "is for identifying by moving the arm", "leave it out, or leave the recordings out")
        answer = _from_recordings(recordings, hold_out or [], arm, hold or [], topic, estimator, band_hz, out)
    else:
        reading = (("--hold-out", hold_out), ("--hold", hold), ("--out", out))
        refuse(reading, "is for identifying from recordings", "give recordings to learn from")
        if design and motion:
            raise InputError("--design", "makes the motion itself", "leave --motion out, or --design")
        asked = {
            "motions": [_designed(arm)] if design else [motion_reference(m) for m in motion or []],
            "mode": mode,
            "controller": controller,
            "estimator": estimator,
            "band_hz": band_hz,
            "attached": attached,
        }
        answer = conduct(arm, "identify_links", asked)
    from service.reports.link_tables import link_report

    for note in [*answer["notes"], *answer["warnings"]]:
        say(f"etude: {note}")
    publish(answer, json, *link_report(answer))


def _designed(arm: str | None) -> str:
    """The file of a motion designed for the arm whose daemon is asked."""
    from service.identification.designed_motion import design_motion

    installation = installation_of(arm)
    directory = new_directory("design")
    directory.mkdir(parents=True)
    say(f"designing a motion for {installation.arm.name} …")
    report = design_motion(installation, directory / f"{installation.arm.name}-designed.toml")
    say(report.sentence)
    return str(report.path)


def _from_recordings(
    recordings: list[str],
    hold_out: list[str],
    arm: str | None,
    hold: list[str],
    topic: str,
    estimator: EstimatorName,
    band_hz: float | None,
    out: Path | None,
) -> dict[str, Any]:
    from service.identification.arm_source import parse_holds
    from service.identification.links import identify as identify_from

    request = LinksRequest(
        recordings=as_paths(recordings),
        hold_out=as_paths(hold_out),
        directory=out.absolute() if out else new_directory("links"),
        arm=arm,
        hold=parse_holds(hold),
        topic=topic,
        estimator=estimator,
        band_hz=band_hz,
    )
    with progress() as tell:
        return identify_from(request, tell).answer
