"""A scenario over the wire: the stand-in arm and the daemon as processes in lockstep, recordings as any user's."""

from __future__ import annotations

import re
import shutil
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from benchmarks.campaign.cause import named
from benchmarks.campaign.motions import RATE_HZ
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.scenario import Prepared, Truth, prepare
from benchmarks.campaign.sealing import ANSWER, HELD_OUT, QUESTION, Envelope, Question
from config.motion import SampledMotion
from service.daemon.client import DaemonClient
from service.supervision import SupervisedProcess
from virtual_hw.hidden import HiddenMechanics

READY_S = 120.0
PATH_HZ = 50.0
"""Points a second of the path that a motion file gives; a spline goes through them."""


def sealed_over_the_wire(plan: Plan, folder: Path) -> tuple[Question, Envelope]:
    """Play the plan's scenario on the stand-in arm behind the daemon and seal it in ``folder``.

    The recordings are the daemon's own MCAP files. Nothing of the mechanics is left where they could lead.
    """
    question = folder / QUESTION
    question.mkdir(parents=True)
    (folder / ANSWER).mkdir()
    prepared = prepare(plan, question / "arm.urdf")
    with tempfile.TemporaryDirectory(prefix="etude-wire-") as place, brought_up(prepared, Path(place)) as run:
        motions = {
            name: motion_file(Path(place), motion, prepared) for name, motion in prepared.playlist.motions.items()
        }
        with DaemonClient(run, prepared.installation.arm.name) as daemon:
            for number, motion in enumerate(prepared.playlist.order, 1):
                played = daemon.call("run", {"motion": str(motions[motion])}, lambda news: None)
                kind = HELD_OUT if motion.startswith(HELD_OUT) else "run"
                shutil.copy(played["recording"], question / f"{kind}-{number:02d}.mcap")
    return Question(question), Envelope.close(_as_measured(prepared.truth), folder / ANSWER / "truth.json")


def _as_measured(truth: Truth) -> Truth:
    """A drive measures at the end of a tick the torque that it held over it: half a tick late, and rightly named so."""
    return replace(truth, excused=truth.excused | named("transport_delay", None))


@contextmanager
def brought_up(prepared: Prepared, folder: Path) -> Iterator[Path]:
    """Stand-in and daemon with the scenario's mechanics, in lockstep; yields their run directory."""
    installation, hidden = _installation_file(prepared, folder), folder / "mechanics.toml"
    hidden.write_text(as_toml(prepared.hidden), encoding="utf-8")
    environment = {"ETUDE_RUN": str(folder / "run"), "ETUDE_STATE": str(folder / "state")}
    (folder / "run").mkdir()
    with ExitStack() as stack:
        log = stack.enter_context((folder / "processes.log").open("wb"))
        for command in (["virtual", "--seed", str(prepared.seed), "--hidden", str(hidden)], ["daemon"]):
            arguments = [command[0], "--config", str(installation), "--lockstep", *command[1:]]
            process = SupervisedProcess(arguments, environment, log=log.fileno())
            stack.callback(process.stop)
            process.wait_ready(READY_S)
        yield folder / "run"


def _installation_file(prepared: Prepared, folder: Path) -> Path:
    """The arm's installation with the finder's URDF."""
    text = prepared.installation.path.read_text(encoding="utf-8")
    text, changed = re.subn(r"^urdf = .*$", f'urdf = "{prepared.installation.arm.urdf}"', text, flags=re.MULTILINE)
    if changed != 1:
        raise ValueError(f"{prepared.installation.path}: has {changed} keys 'urdf', not one")
    installation = folder / "installation.toml"
    installation.write_text(text, encoding="utf-8")
    return installation


def as_toml(hidden: HiddenMechanics) -> str:
    """Hidden mechanics as the file that they would be read from."""
    tables: dict[str, Any] = hidden.model_dump(mode="json", exclude_defaults=True)
    plain = {key: value for key, value in tables.items() if not isinstance(value, list | dict)}
    lines = [f"{key} = {_value(value)}" for key, value in plain.items()]
    for key, value in tables.items():
        for entry in value if isinstance(value, list) else [value] if isinstance(value, dict) else []:
            lines += ["", f"[[{key}]]" if isinstance(value, list) else f"[{key}]"]
            lines += [f"{name} = {_value(inner)}" for name, inner in entry.items() if inner is not None]
    return "\n".join(lines) + "\n"


def _value(value: Any) -> str:
    """A value on one line."""
    if isinstance(value, dict):
        return (
            "{ " + ", ".join(f"{name} = {_value(inner)}" for name, inner in value.items() if inner is not None) + " }"
        )
    if isinstance(value, list):
        return "[" + ", ".join(_value(inner) for inner in value) + "]"
    if isinstance(value, bool):
        return "true" if value else "false"
    return f'"{value}"' if isinstance(value, str) else repr(value)


def motion_file(folder: Path, motion: SampledMotion, prepared: Prepared) -> Path:
    """The motion as a path in a CSV file and the motion file that names it."""
    joints = prepared.installation.joint_names
    kept = np.unique(np.append(np.arange(0, len(motion.t), int(RATE_HZ / PATH_HZ)), len(motion.t) - 1))
    header = ",".join(["t", *(f"q_{joint}" for joint in joints)])
    table = np.column_stack([motion.t[kept], motion.q[kept]])
    path = folder / f"{motion.name}.csv"
    np.savetxt(path, table, fmt="%.12g", delimiter=",", header=header, comments="")
    file = folder / f"{motion.name}.toml"
    file.write_text(f'kind = "recorded"\nfile = "{path.name}"\n', encoding="utf-8")
    return file
