"""The command `identify load`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from config import InputError
from service import outcomes
from service.cli.asking import ControllerOption, ModeOption, conduct, motion_reference
from service.cli.console import progress, publish, say
from service.cli.options import (
    JOINT_STATES,
    ArmOption,
    AttachedOption,
    BandOption,
    FrameOption,
    HoldOption,
    HoldOutOption,
    JsonOption,
    MotionsOption,
    Names,
    OutOption,
    TopicOption,
    new_directory,
    refuse,
)
from service.identification.request import LoadForm, LoadRequest, Tolerance, as_paths

LEAVE_OUT = "leave it out"


def load(
    recordings: Annotated[
        Names,
        typer.Argument(metavar="[RECORDING]...", help="Recordings with the load. None: the arm moves itself."),
    ] = None,
    without: Annotated[
        Names,
        typer.Option("--without", metavar="FREE", help="Recording without the load: joint torques tell; repeat."),
    ] = None,
    hold_out: HoldOutOption = None,
    tare: Annotated[
        Names,
        typer.Option("--tare", metavar="RECORDING", help="At rest without the load, before or after; repeat."),
    ] = None,
    hand: Annotated[
        Path | None, typer.Option("--hand", metavar="FILE", help="The hand's load file: it is subtracted.")
    ] = None,
    library: Annotated[
        Path | None, typer.Option("--load-library", metavar="FILE", help="Recognise it among the loads of this file.")
    ] = None,
    expect: Annotated[
        Path | None, typer.Option("--expect", metavar="FILE", help="Verify that it is the load of this file.")
    ] = None,
    mass_tolerance: Annotated[
        float, typer.Option("--mass-tolerance", metavar="KG", help="With --expect.")
    ] = Tolerance.mass_kg,
    centre_tolerance: Annotated[
        float, typer.Option("--centre-tolerance", metavar="M", help="With --expect, a coordinate.")
    ] = Tolerance.centre_m,
    arm: ArmOption = None,
    hold: HoldOption = None,
    topic: TopicOption = JOINT_STATES,
    frame: FrameOption = None,
    form: Annotated[LoadForm, typer.Option("--form", help="Of the equation; static: rests alone.")] = "differentiated",
    band_hz: BandOption = None,
    motion: MotionsOption = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    attached: AttachedOption = False,
    out: OutOption = None,
    json: JsonOption = None,
) -> None:
    """Identify a load, from recordings or by moving the arm; by the wrist sensor, or --without it by joint torques.

    Exit code 1: not the expected load, or none of the known ones.
    """
    judgement = {
        "hand": _absolute(hand),
        "library": _absolute(library),
        "expect": _absolute(expect),
        "tolerance": Tolerance(mass_tolerance, centre_tolerance),
        "form": form,
        "band_hz": band_hz,
    }
    if recordings:
        moving = (("--motion", motion), ("--attached", attached))
        refuse(moving, "is for identifying by moving the arm", LEAVE_OUT)
        unfit = (("--tare", tare), ("--hand", hand), ("--hold-out", hold_out)) if without else ()
        refuse(unfit, "is for identifying from wrenches", LEAVE_OUT)
        if without and form != "differentiated":
            raise InputError("--form", "has no choice when joint torques tell", "leave it out")
        answer = _from_recordings(
            recordings, without or [], hold_out or [], tare or [], arm, hold or [], topic, frame, out, judgement
        )
    else:
        only = (("--without", without), ("--hold-out", hold_out), ("--hold", hold), ("--out", out), ("--frame", frame))
        refuse(only, "is for identifying from recordings", LEAVE_OUT)
        asked = {
            "motions": [motion_reference(m) for m in motion or []],
            "tares": [str(path) for path in as_paths(tare or [])],
            "hand": _text(hand),
            "library": _text(library),
            "expect": _text(expect),
            "mass_tolerance": mass_tolerance,
            "centre_tolerance": centre_tolerance,
            "form": form,
            "band_hz": band_hz,
            "mode": mode,
            "controller": controller,
            "attached": attached,
        }
        answer = conduct(arm, "identify_load", asked)
    from service.identification.load_judgement import is_no
    from service.reports.load_tables import load_report

    for note in [*answer["notes"], *answer["warnings"]]:
        say(f"etude: {note}")
    publish(answer, json, *load_report(answer))
    if is_no(answer):
        raise typer.Exit(outcomes.ANSWER_IS_NO)


def _from_recordings(
    recordings: list[str],
    without: list[str],
    hold_out: list[str],
    tares: list[str],
    arm: str | None,
    hold: list[str],
    topic: str,
    frame: str | None,
    out: Path | None,
    judgement: dict[str, Any],
) -> dict[str, Any]:
    from service.identification.arm_source import parse_holds
    from service.identification.loads import identify

    request = LoadRequest(
        recordings=as_paths(recordings),
        without=as_paths(without),
        hold_out=as_paths(hold_out),
        tares=as_paths(tares),
        directory=out.absolute() if out else new_directory("load"),
        arm=arm,
        hold=parse_holds(hold),
        topic=topic,
        frame=frame,
        **judgement,
    )
    with progress() as tell:
        return identify(request, tell).answer


def _absolute(path: Path | None) -> Path | None:
    return None if path is None else path.absolute()


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path.absolute())
