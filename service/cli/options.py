"""Options that several commands share, and how an arm is chosen when none is named."""

from __future__ import annotations

import os
from collections.abc import Iterable, Sequence
from datetime import UTC, datetime
from pathlib import Path
from typing import TYPE_CHECKING, Annotated

import typer

from config import InputError
from config.paths import run_directory
from service.cli.console import STDOUT
from service.daemon.client import DaemonClient
from service.outcomes import NoDaemon

if TYPE_CHECKING:
    from config import Installation

DEFAULT_ARM = "dda"


def _json_target(given: str | None) -> str | None:
    """Refuse a file that cannot be written before anything is done: an answer without a place would be lost."""
    if given is None or given == STDOUT:
        return given
    path = Path(given)
    if path.exists() and not path.is_file():  # a device or a pipe would be replaced by the answer, not written to
        what = "is a directory" if path.is_dir() else "is no regular file"
        raise InputError(f"--json {given}", what, "name a file, or - for standard output")
    if not os.access(path.parent, os.W_OK | os.X_OK):
        why = "no permission to write there" if path.parent.is_dir() else f"there is no directory {path.parent}"
        raise InputError(f"--json {given}", f"the answer cannot be written here ({why})", "name another file")
    return given


def _out_target(given: Path | None) -> Path | None:
    """Refuse a directory that cannot be made before anything is done, for the same reason."""
    if given is None:
        return None
    there = next(path for path in (given.absolute(), *given.absolute().parents) if path.exists())
    if not there.is_dir():
        raise InputError(f"--out {given}", f"{there} is no directory", "name another directory")
    if not os.access(there, os.W_OK | os.X_OK):
        raise InputError(f"--out {given}", f"no permission to write in {there}", "name another directory")
    return given


def keep_inputs(json: str | None, *named: Sequence[str] | None) -> None:
    """Raise InputError where the answer would be written over one of the files that a command reads."""
    if json is None or json == STDOUT:
        return
    target = Path(json).resolve()
    for given in (path for paths in named for path in paths or ()):
        if Path(given).resolve() == target:
            raise InputError(f"--json {json}", "is one of the recordings", "name another file; nothing was overwritten")


JsonOption = Annotated[
    str | None,
    typer.Option(
        "--json",
        metavar="FILE",
        help="Write the answer as JSON ('-': standard output).",
        callback=_json_target,
    ),
]
ArmOption = Annotated[
    str | None,
    typer.Option(
        "--arm",
        metavar="NAME",
        help="Configured arm, or an installation file; for recordings also a URDF. [$ETUDE_ARM, else the running one]",
    ),
]
OfArmOption = Annotated[str | None, typer.Option("--arm", metavar="NAME", help="Refuse what is of another arm.")]
AttachedOption = Annotated[
    bool, typer.Option("--attached", help="Stop the arm when this client goes away; by default the session carries on.")
]
Names = list[str] | None
HoldOutOption = Annotated[
    Names, typer.Option("--hold-out", metavar="RECORDING", help="Judge on this one; repeat for several.")
]
DrivesOffOption = Annotated[
    Names,
    typer.Option(
        "--drives-off",
        metavar="RECORDING",
        help="At rest with the drives off: what their torques read then is their offset; repeat for several.",
    ),
]
HoldOption = Annotated[
    Names,
    typer.Option("--hold", metavar="JOINT=VALUE", help="A joint of the URDF that stands still; repeat for several."),
]
TopicOption = Annotated[str, typer.Option("--topic", help="JointState topic of a foreign MCAP.")]
JOINT_STATES = "/joint_states"
FrameOption = Annotated[
    str | None, typer.Option("--frame", metavar="LINK", help="The sensor's link of the URDF. [the configured one]")
]
MotionsOption = Annotated[
    Names, typer.Option("--motion", help="Motion to play, in place of the arm's own list; repeat for several.")
]
BandOption = Annotated[float | None, typer.Option("--band", metavar="HZ", help="Band of the estimate.", min=0.1)]
OutOption = Annotated[
    Path | None,
    typer.Option("--out", metavar="DIR", help="Where the results go. [the state directory]", callback=_out_target),
]


def refuse(options: Iterable[tuple[str, object]], problem: str, remedy: str) -> None:
    """Raise InputError for the first of these options (name, value) that was given."""
    for name, given in options:
        if given:
            raise InputError(name, problem, remedy)


def require_same_arm(place: str, found: str | None, arm: str | None) -> None:
    """Raise InputError for what is of arm ``found`` where another one was named; None is unknown, or not named."""
    if arm and found is not None and found != (wanted := arm_to_ask(arm)):
        raise InputError(place, f"is of arm {found}, not of {wanted}", f"name that arm: --arm {found}")


def arm_to_start(arm: str | None) -> str:
    """The installation that `up` means: a name or a file."""
    return arm or os.environ.get("ETUDE_ARM") or DEFAULT_ARM


def installation_of(arm: str | None) -> Installation:
    """The installation as given, else of $ETUDE_ARM, else of the only daemon that runs, else the first arm's.

    Raises InputError when several daemons run and none was named.
    """
    from config import load_installation

    named = arm or os.environ.get("ETUDE_ARM")
    if not named and (running := arm_to_ask(None)) in running_arms():
        try:
            with DaemonClient(run_directory(), running, looks_only=True) as daemon:
                named = str(daemon.call("status")["installation"])
        except NoDaemon:  # it was killed, and its socket is all that is left of it
            named = running
    return load_installation(named or DEFAULT_ARM)


def arm_to_ask(arm: str | None) -> str:
    """The name of the arm whose daemon a client asks: as given, else $ETUDE_ARM, else the only one running.

    Raises InputError when several daemons run and none was named.
    """
    named = arm or os.environ.get("ETUDE_ARM")
    if named:
        return named if not _is_file(named) else _name_in(named)
    running = running_arms()
    if len(running) > 1:
        raise InputError("--arm", f"daemons run for {', '.join(running)}", "say which one you mean")
    return running[0] if running else DEFAULT_ARM


def running_arms() -> list[str]:
    """Names of the arms whose daemons have a socket here."""
    return sorted(path.stem for path in run_directory().glob("*.sock") if not path.stem.endswith("-look"))


def _is_file(arm: str) -> bool:
    return arm.endswith(".toml") or os.sep in arm


def _name_in(path: str) -> str:
    from config import load_installation

    return load_installation(str(Path(path))).arm.name


def new_directory(what: str) -> Path:
    """Where the results of a command go when ``--out`` does not say: one of its own in the state directory."""
    from config.paths import state_directory

    stem = state_directory() / "identified"
    name = f"{what}-{datetime.now(UTC):%Y%m%d-%H%M%S}"
    number = 1
    while (stem / (name if number == 1 else f"{name}-{number}")).exists():
        number += 1
    return stem / (name if number == 1 else f"{name}-{number}")
