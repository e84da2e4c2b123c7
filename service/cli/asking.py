"""Commands that ask the daemon: `status`, `stop`, `reset`, `run`."""

from __future__ import annotations

import os
import sys
from pathlib import Path
from typing import Annotated, Any, Literal

import typer
from rich.table import Table

from config.paths import run_directory
from service.cli.console import progress, publish, say
from service.cli.options import ArmOption, AttachedOption, JsonOption, arm_to_ask
from service.daemon.client import DaemonClient

ModeOption = Annotated[
    Literal["csp", "cst"],
    typer.Option("--mode", help="csp: the servo is in the drive; cst: the controller is in the loop."),
]
ControllerOption = Annotated[
    Literal["pd", "computed_torque"], typer.Option("--controller", help="Controller in torque mode (cst).")
]
FRAMES_SHOWN = 6
"""Of those kept from before a stop."""


def status(arm: ArmOption = None, json: JsonOption = None) -> None:
    """What the arm and its daemon are doing."""
    with DaemonClient(run_directory(), arm_to_ask(arm), looks_only=True) as daemon:
        answer = daemon.call("status")
    publish(answer, json, *_shown(answer))


def stop(arm: ArmOption = None, json: JsonOption = None) -> None:
    """Stop all axes now. The stop is latched: etude reset acknowledges it."""
    with DaemonClient(run_directory(), arm_to_ask(arm)) as daemon:
        answer = daemon.call("stop")
    publish(answer, json, *_shown(answer))


def reset(arm: ArmOption = None, json: JsonOption = None) -> None:
    """Acknowledge a latched fault; the arm stays where it is, its drives not enabled."""
    with DaemonClient(run_directory(), arm_to_ask(arm)) as daemon:
        answer = daemon.call("reset")
    publish(answer, json, *_shown(answer))


def run(
    motion: Annotated[str, typer.Argument(metavar="MOTION", help="A motion's name, or its file.")],
    arm: ArmOption = None,
    mode: ModeOption = "csp",
    controller: ControllerOption = "pd",
    feedforward: Annotated[
        str | None,
        typer.Option(
            "--feedforward",
            metavar="MODEL",
            help="Model by file or name; what practice learnt on this motion (CSV); its session.",
        ),
    ] = None,
    attached: AttachedOption = False,
    json: JsonOption = None,
) -> None:
    """Play a motion and record it."""
    asked = {
        "motion": motion_reference(motion),
        "mode": mode,
        "controller": controller,
        "feedforward": model_reference(feedforward),
        "attached": attached,
    }
    answer = conduct(arm, "run", asked)
    table = Table("joint", "position rms [rad]", "peak", "velocity rms [rad/s]", "peak", box=None)
    for joint, error in answer["tracking_error"].items():
        keys = ("position_rms", "position_peak", "velocity_rms", "velocity_peak")
        table.add_row(joint, *(_figure(error.get(key)) for key in keys))
    publish(
        answer,
        json,
        f"played {answer['motion']}, {answer['samples']} samples; tracking errors:",
        table,
        *(
            f"wrench sensor {name} is silent ({why}): the recording lacks what it would have told"
            for name, why in answer["silent_sensors"].items()
        ),
        answer["recording"],
    )


def conduct(arm: str | None, command: str, arguments: dict[str, Any]) -> dict[str, Any]:
    """Have the daemon conduct a session, show its progress, return its answer. Leaving it by Ctrl-C says what
    becomes of it."""
    session = ""
    name = arm_to_ask(arm)
    with DaemonClient(run_directory(), name) as daemon, progress() as tell:

        def news(message: dict[str, Any]) -> None:
            nonlocal session
            session = message["session"]
            if message["stage"]:
                # Where a line stays once it is written, one for each new figure would bury the others.
                load = f", load {_mass(message['load'])}" if message["load"] and sys.stderr.isatty() else ""
                tell(message["stage"] + load, message["share"])

        try:
            return daemon.call(command, arguments, news)
        except KeyboardInterrupt:
            if session and arguments.get("attached"):
                say(f"session {session} was attached: the arm stops")
            elif session:
                say(f"session {session} carries on; etude report {session} tells what came of it, etude stop ends it")
            raise


def motion_reference(given: str) -> str:
    """A motion's file as an absolute path, since the daemon works elsewhere; a name as it is."""
    return str(Path(given).absolute()) if given.endswith(".toml") or os.sep in given else given


def model_reference(given: str | None) -> str | None:
    """The same for a model, or a learnt feedforward; a name as it is."""
    if given is None:
        return None
    return str(Path(given).absolute()) if Path(given).suffix in (".toml", ".csv") or os.sep in given else given


def _shown(status: dict[str, Any]) -> list[Any]:
    headline = f"arm {status['arm']}: {status['state']}"
    if status["mode"]:
        headline += f" in {status['mode']}"
    if status["cause"]:
        headline += f": {status['cause']}"
    joints = Table("joint", "drive", "q [rad]", "dq [rad/s]", "tau [N·m]", box=None)
    for k, joint in enumerate(status["joints"]):
        numbers = (_figure(status[key][k]) for key in ("q", "dq", "tau"))
        joints.add_row(joint, status["drive_states"][k], *numbers)
    stopped = []
    if status["state"] == "latched":
        stopped = [
            f"see to the cause; etude reset --arm {status['arm']} then acknowledges the stop, without moving the arm",
            *(f"  {line}" for line in status["last_frames"][-FRAMES_SHOWN:]),
        ]
        if status["last_frames"]:
            stopped.insert(1, f"last of the {len(status['last_frames'])} frames and deliveries kept (--json has all):")
    loop = (
        f"loop: {status['cycles']} cycles, {status['missed']} missed, worst lateness "
        f"{status['lateness_max_us']:.0f} µs, {status['cpu_us']:.0f} µs CPU a cycle"
        + (", lockstep" if status["lockstep"] else f", {status['realtime']['scheduling']}")
    )
    lines = [headline, *stopped, joints, loop]
    lines += [f"bus {b['name']}: {100 * b['load']:.0f} % load, {b['errors']} errors" for b in status["buses"]]
    for sensor in status["sensors"]:
        age = "no sample yet" if sensor["age_ms"] is None else f"{sensor['age_ms']:.0f} ms old"
        lines.append(
            f"sensor {sensor['name']}: {sensor['samples']} samples, {age}"
            + (f", stale: {sensor['condition']}" if sensor["stale"] else "")
        )
    recorder = status["recorder"]
    if recorder["last_death"]:
        fresh = "" if recorder["state"] == "gone" else f"; a fresh one is {recorder['state']}"
        lines.append(f"recorder: {recorder['last_death']}{fresh}")
    if status["load"]:
        lines.append(f"load in the last motion: {_mass(status['load'])}")
    if status["session"]:
        s = status["session"]
        lines.append(f"session {s['id']}: {s['state']}, {s['stage']} ({100 * s['progress']:.0f} %)")
    return lines


def _mass(load: dict[str, Any]) -> str:
    mass = load["mass"]
    named = f" ({load['name']})" if load["name"] else ""
    return f"{mass['value']:.3f} ± {mass['standard_error']:.3f} {mass['unit']}{named}"


def _figure(value: float | None) -> str:
    return "–" if value is None else f"{value:.4g}"
