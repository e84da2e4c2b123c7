"""Commands that practise: `certify`, `practise`, `retime`, and `compare-controllers`."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Literal

import typer

from config.errors import InputError
from service import outcomes
from service.cli.asking import ModeOption, conduct, model_reference, motion_reference
from service.cli.console import publish
from service.cli.options import ArmOption, AttachedOption, JsonOption, installation_of, refuse

MotionArgument = Annotated[str, typer.Argument(metavar="MOTION", help="A motion's name, or its file.")]
ModelOption = Annotated[
    str | None,
    typer.Option("--model", metavar="MODEL", help="A model file, an arm's newest model, or ARM@VERSION. [its URDF]"),
]
OperatorOption = Annotated[
    Literal["thesis", "decoupled", "proportional"],
    typer.Option("--operator", help="What makes a correction of an error: the full model, one inertia a joint, none."),
]
BandOption = Annotated[
    float | None,
    typer.Option("--band", metavar="HZ", help="Learn nothing above it. [as far as it converges]", min=0.1),
]

RefusedControllerOption = Annotated[Literal["pd", "computed_torque"], typer.Option("--controller", hidden=True)]
"""`etude run` knows it: practice says why it does not."""


def certify(
    motion: MotionArgument,
    arm: ArmOption = None,
    model: ModelOption = None,
    operator: OperatorOption = "thesis",
    mode: ModeOption = "csp",
    controller: RefusedControllerOption = "pd",
    band_hz: BandOption = None,
    json: JsonOption = None,
) -> None:
    """Would practising this motion help? Looks at the model alone; nothing moves."""
    _require_feedforward(controller)
    from service.practice.answers import certificate_answer, certificate_report
    from service.practice.course import PracticeArguments, course

    asked = PracticeArguments(motion=motion, model=model, operator=operator, mode=mode, band_hz=band_hz)
    found = course(asked, installation_of(arm))
    answer = certificate_answer(found)
    publish(answer, json, *certificate_report(answer))
    if not found.certificate.admitted:
        raise typer.Exit(outcomes.ANSWER_IS_NO)


def practise(
    motion: Annotated[str | None, typer.Argument(metavar="[MOTION]", help="A motion's name, or its file.")] = None,
    task: Annotated[
        str | None,
        typer.Option("--task", metavar="FILE", help="In place of a motion: hit a point at a time, carry a payload."),
    ] = None,
    trials: Annotated[int, typer.Option("--trials", help="Most practice movements.", min=1, max=100)] = 10,
    replays: Annotated[
        int,
        typer.Option("--replays", help="Plays of the model's feedforward that measure repeatability.", min=5, max=50),
    ] = 5,
    arm: ArmOption = None,
    model: ModelOption = None,
    operator: OperatorOption = "thesis",
    mode: ModeOption = "csp",
    controller: RefusedControllerOption = "pd",
    band_hz: BandOption = None,
    hand_picked_hz: Annotated[
        float | None,
        typer.Option(
            "--hand-picked", metavar="HZ", help="Gain one below this frequency, as in the thesis (8); no trial filter."
        ),
    ] = None,
    resume: Annotated[
        str | None, typer.Option("--resume", metavar="SESSION", help="Carry on a session that ended early.")
    ] = None,
    attached: AttachedOption = False,
    json: JsonOption = None,
) -> None:
    """Practise a motion until it is as good as the arm repeats itself, or a task until its miss is chance."""
    _require_feedforward(controller)
    if (motion is None) == (task is None):
        raise InputError("practise", "needs a MOTION or a --task, one of the two", "name what is to be practised")
    if task is not None:
        refuse(
            [("--band", band_hz), ("--hand-picked", hand_picked_hz), ("--resume", resume)]
            + [("--operator", operator != "thesis")],
            "goes with a motion",
            "leave it out",
        )
        _learn_task(task, {"model": model_reference(model), "mode": mode}, trials, replays, arm, attached, json)
        return
    assert motion is not None
    from service.practice.answers import practice_report

    asked = {
        "motion": motion_reference(motion),
        "trials": trials,
        "replays": replays,
        "model": model_reference(model),
        "operator": operator,
        "mode": mode,
        "band_hz": band_hz,
        "hand_picked_hz": hand_picked_hz,
        "resume": resume,
        "attached": attached,
    }
    answer = conduct(arm, "practise", asked)
    publish(answer, json, *practice_report(answer))


def _require_feedforward(controller: str) -> None:
    if controller != "pd":
        raise InputError(
            "--controller",
            "computed torque makes its own torque of the measured state, and practice learns the torque of the wanted "
            "motion as feedforward",
            "leave it out: --mode cst practises with pd and feedforward, which on the wanted motion ask for the same",
        )


def _learn_task(
    task: str,
    asked: dict[str, object],
    trials: int,
    replays: int,
    arm: str | None,
    attached: bool,
    json: str | None,
) -> None:
    from service.reports.task_plot import task_report

    asked |= {"task": str(Path(task).absolute()), "trials": trials, "replays": replays, "attached": attached}
    answer = conduct(arm, "learn_task", asked)
    publish(answer, json, *task_report(answer))


def retime(
    motion: MotionArgument,
    out: Annotated[
        Path, typer.Option("--out", metavar="FILE", help="Motion file (TOML) to write; its path beside it.")
    ],
    arm: ArmOption = None,
    model: ModelOption = None,
    angle_error: Annotated[
        float, typer.Option("--angle-error", metavar="RAD", help="Largest tracking error that was measured.", min=0.0)
    ] = 2e-3,
    speed_error: Annotated[
        float, typer.Option("--speed-error", metavar="RAD/S", help="The same of the velocities.", min=0.0)
    ] = 0.02,
    json: JsonOption = None,
) -> None:
    """The same path as fast as the arm can: by the model, within the torque that tracking leaves free."""
    from config import InputError
    from service.practice.retimed import retimed_motion

    if out.suffix != ".toml":
        raise InputError("--out", f"{out} is no motion file", "name it something.toml")
    installation = installation_of(arm)
    answer = retimed_motion(motion, model, (angle_error, speed_error), installation, out.absolute())
    shares = answer["largest_share_of_torque_limit"]
    publish(
        answer,
        json,
        f"{motion}: {answer['duration_s']:.3f} s in place of {answer['duration_before_s']:.3f} s",
        "largest share of the torque limit: " + ", ".join(f"{name} {100 * x:.0f} %" for name, x in shares.items()),
        answer["retimed"],
    )


def compare_controllers(
    motion: MotionArgument,
    arm: ArmOption = None,
    model: ModelOption = None,
    attached: AttachedOption = False,
    json: JsonOption = None,
) -> None:
    """Play a motion under every controller of Appendix A and compare the tracking errors."""
    asked = {
        "motion": motion_reference(motion),
        "model": model_reference(model),
        "attached": attached,
    }
    answer = conduct(arm, "compare_controllers", asked)
    from service.reports.controller_plot import controller_report

    publish(answer, json, *controller_report(answer))
