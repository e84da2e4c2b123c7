"""Commands that serve: `up`, `daemon`, `virtual`. Their answer is given once they are ready."""

from __future__ import annotations

import os
import signal
import time
from collections.abc import Callable, Sequence
from contextlib import ExitStack
from pathlib import Path
from types import FrameType
from typing import TYPE_CHECKING, Annotated, Any

import typer

from config.paths import run_directory
from service.cli.console import announce, say
from service.cli.options import ArmOption, JsonOption, OfArmOption, arm_to_start, require_same_arm
from service.daemon.protocol import control_socket
from service.outcomes import BAD_INPUT
from service.supervision import StartFailed, SupervisedProcess

if TYPE_CHECKING:
    from config import Installation

READY_TIMEOUT_S = 60.0

ConfigOption = Annotated[str, typer.Option("--config", metavar="FILE", help="Installation file, or a configured arm.")]
LockstepOption = Annotated[
    bool, typer.Option("--lockstep", help="Virtual time: deterministic, and as fast as the machine allows.")
]
SeedOption = Annotated[int, typer.Option("--seed", help="Seed of the stand-in's noise.", min=0)]


def up(
    arm: ArmOption = None,
    virtual: Annotated[bool, typer.Option("--virtual", help="With the stand-in arm in the hardware's place.")] = False,
    lockstep: LockstepOption = False,
    seed: SeedOption = 0,
    json: JsonOption = None,
) -> None:
    """Run the daemon, and the stand-in arm with --virtual, in the foreground; Ctrl-C ends all in order."""
    from config import InputError, load_installation

    if lockstep and not virtual:
        raise InputError("--lockstep", "hardware keeps its own time", "add --virtual, or leave --lockstep out")
    chosen = arm_to_start(arm)
    installation = load_installation(chosen)
    config = str(installation.path)
    commands: list[list[str]] = []
    if virtual:
        commands.append(["virtual", "--config", config, "--seed", str(seed), *(["--lockstep"] if lockstep else [])])
    commands.append(["daemon", "--config", config, *(["--lockstep"] if lockstep else [])])
    answer = _reached(installation, lockstep) | {"virtual": virtual}

    def ready(processes: Sequence[SupervisedProcess]) -> None:
        told = [{"name": process.name, "pid": process.process.pid} for process in processes]
        announce(answer | {"processes": told}, json)

    raise typer.Exit(supervise(commands, installation.arm.name, ready))


def supervise(commands: Sequence[Sequence[str]], arm: str, ready: Callable[[Sequence[SupervisedProcess]], None]) -> int:
    """Start the commands one after another, each when the one before is ready; stop all, newest first, when one
    ends or a signal comes. ``ready`` is called once, when all are. Returns the exit code: 0 after a signal, else that
    of the process that ended."""
    asked_to_end = False

    def end(signal_number: int, frame: FrameType | None) -> None:
        nonlocal asked_to_end
        asked_to_end = True

    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, end)
    running: list[SupervisedProcess] = []
    with ExitStack() as stack:
        for command in commands:
            process = SupervisedProcess(command)
            stack.callback(process.stop)
            running.append(process)
            try:
                process.wait_ready(READY_TIMEOUT_S)
            except StartFailed as failure:
                if asked_to_end:
                    return 0
                if failure.code != BAD_INPUT:  # of which the process has said the one sentence there is
                    say(f"etude: {failure}")
                return failure.code
            say(f"etude {process.name}: ready")
        ready(running)
        say(f"arm {arm} is up; etude status --arm {arm} looks at it, Ctrl-C ends it")
        while not asked_to_end:
            for process in running:
                if (code := process.process.poll()) is not None:
                    say(f"etude: {process.name} ended with exit code {code}; ending the others")
                    return code if code > 0 else 70
            time.sleep(0.1)
        say("etude: ending")
    return 0


def daemon(
    config: ConfigOption, lockstep: LockstepOption = False, arm: OfArmOption = None, json: JsonOption = None
) -> None:
    """Serve one arm: the cyclic loop, the recorder, sessions and clients. What systemd starts."""
    from service.daemon.process import run_daemon

    installation = _installation(config, arm)
    answer = _reached(installation, lockstep) | {"pid": os.getpid()}
    run_daemon(installation, lockstep=lockstep, ready=lambda: announce(answer, json))


def virtual(
    config: ConfigOption,
    lockstep: LockstepOption = False,
    seed: SeedOption = 0,
    hidden: Annotated[
        str | None, typer.Option("--hidden", metavar="FILE", help="Hidden mechanics, in place of the installation's.")
    ] = None,
    faults: Annotated[
        Path | None, typer.Option("--faults", metavar="FILE", help="A script of faults that the stand-in shall have.")
    ] = None,
    arm: OfArmOption = None,
    json: JsonOption = None,
) -> None:
    """Be the stand-in arm: drives on the bus, the sensor on its line."""
    from driver.wrench.port import port_path
    from service.daemon.systemd import notify
    from virtual_hw.faults import load_faults
    from virtual_hw.standin import run_standin

    script = None if faults is None else load_faults(faults)
    installation = _installation(config, arm)
    answer = _served(installation, lockstep) | {
        "pid": os.getpid(),
        "seed": seed,
        "buses": [{"name": bus.name, "channel": bus.channel} for bus in installation.bus],
        "lines": [{"name": sensor.name, "path": str(port_path(sensor))} for sensor in installation.wrench_sensor],
    }

    def ready() -> None:
        announce(answer, json)
        if not notify("READY=1"):
            say("etude virtual: ready")

    run_standin(installation, Path(hidden) if hidden else None, lockstep, seed, ready, faults=script)


def _installation(config: str, arm: str | None) -> Installation:
    from config import load_installation

    installation = load_installation(config)
    require_same_arm(f"--config {config}", installation.arm.name, arm)
    return installation


def _served(installation: Installation, lockstep: bool) -> dict[str, Any]:
    return {"arm": installation.arm.name, "installation": str(installation.path), "lockstep": lockstep}


def _reached(installation: Installation, lockstep: bool) -> dict[str, Any]:
    """And where clients reach the daemon. Raises InputError for a socket's path that is too long."""
    socket = control_socket(run_directory(), installation.arm.name)
    return _served(installation, lockstep) | {"socket": str(socket)}
