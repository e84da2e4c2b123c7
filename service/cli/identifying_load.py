"""The command `identify load`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer

from config import InputError
from service import outcomes
from service.cli.asking import ControllerOption, ModeOption, conduct, motion_reference
from service.cli.console import progress, publish, say
from service.cli.options import ArmOption, AttachedOption, JsonOption, new_directory
from service.identification.request import LoadForm, LoadRequest, Tolerance, as_paths

Recordings = list[str] | None


def load(
    recordings: Annotated[
        Recordings,
        typer.Argument(metavar="[RECORDING]...", help="Recordings with the load. None: the arm moves itself."),
    ] = None,
    without: Annotated[
        Recordings,
        typer.Option("--without", metavar="FREE", help="Recording without the load: joint torques tell; repeat."),
    ] = None,
    hold_out: Annotated[
        Recordings, typer.Option("--hold-out", metavar="RECORDING", help="Judge on this one; repeat for several.")
    ] = None,
    tare: Annotated[
        Recordings,
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
    hold: Annotated[
        Recordings,
        typer.Option("--hold", metavar="JOINT=VALUE", help="A joint of the URDF that stands still; repeat."),
    ] = None,
    topic: Annotated[str, typer.Option("--topic", help="JointState topic of a foreign MCAP.")] = "/joint_states",
    frame: Annotated[
        str | None, typer.Option("--frame", metavar="LINK", help="The sensor's link of the URDF. [the configured one]")
    ] = None,
    form: Annotated[LoadForm, typer.Option("--form", help="Of the equation; static: rests alone.")] = "differentiated",
    band_hz: Annotated[
        float | None, typer.Option("--band", metavar="HZ", help="Band of the estimate.", min=0.1)
    ] = None,
    motion: Annotated[
        Recordings, typer.Option("--motion", help="Motion to play, in place of the arm's own list; repeat.")
    ] = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    attached: AttachedOption = False,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="DIR", help="Where load and plot go. [the state directory]")
    ] = None,
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
        _refuse((("--motion", motion), ("--attached", attached)), "is for identifying by moving the arm")
        unfit = (("--tare", tare), ("--hand", hand), ("--hold-out", hold_out)) if without else ()
        _refuse(unfit, "is for identifying from wrenches")
        if without and form != "differentiated":
            raise InputError("--form", "has no choice when joint torques tell", "leave it out")
        answer = _from_recordings(
            recordings, without or [], hold_out or [], tare or [], arm, hold or [], topic, frame, out, judgement
        )
    else:
        only = (("--without", without), ("--hold-out", hold_out), ("--hold", hold), ("--out", out), ("--frame", frame))
        _refuse(only, "is for identifying from recordings")
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


def _refuse(given: tuple[tuple[str, object], ...], problem: str) -> None:
    for name, value in given:
        if value:
            raise InputError(name, problem, "leave it out")


def _absolute(path: Path | None) -> Path | None:
    return None if path is None else path.absolute()


def _text(path: Path | None) -> str | None:
    return None if path is None else str(path.absolute())
