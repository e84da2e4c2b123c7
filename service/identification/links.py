"""Identify links from recordings: read, estimate, keep the model and the plot, answer.

The same function serves the command line, in its own process, and the daemon, in a worker process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError, load_installation
from driver.recording import Recording
from estimator.consistency import consistent_parameters
from estimator.export import urdf_text
from estimator.identification import LinkIdentification
from estimator.links import LinkOptions, identify_links
from estimator.prediction import torque_history
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory
from service.identification.arm_source import ArmSource, arm_source, of_installation
from service.identification.model_file import write_link_model
from service.identification.recorded import Source, read_any, source_of, trajectory_of
from service.identification.request import LinksRequest
from service.reports.torque_plot import plot_torques
from service.sessions.store import write_atomically

Tell = Callable[[str, float], None]
FAR_OFF = 3.0
"""Standard errors by which a body's parameters may miss the identified ones without a word."""


@dataclass(frozen=True)
class LinksOutcome:
    """An identification with everything that was made of it. ``urdf``: None where no bodies can have the parameters."""

    result: LinkIdentification
    trajectories: tuple[Trajectory, ...]
    model: Path
    urdf: Path | None
    plot: Path
    answer: dict[str, Any]


def identify(request: LinksRequest, tell: Tell = lambda stage, share: None) -> LinksOutcome:
    """Read, estimate, write the model file and the plot.

    Raises InputError naming file, line and column for recordings that cannot be used.
    """
    body, arm, sources, trajectories, hold_out, notes = _read(request, tell)
    tell("estimating", 0.4)
    options = LinkOptions(estimator=request.estimator, band_hz=request.band_hz)
    result = identify_links(body, trajectories, options, hold_out)
    tell("writing the model and the plot", 0.85)
    try:
        request.directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(request.directory), f"cannot be made ({error.strerror})", "choose another --out") from None
    model = request.directory / "links.toml"
    write_link_model(model, arm.name, result, sources)
    urdf = _write_urdf(request.directory / "links.urdf", result, notes)
    plot = request.directory / "torques.png"
    plot_torques(plot, arm.name, result, (hold_out or trajectories)[0], held_out=bool(hold_out))
    answer = {
        "arm": arm.name,
        **result.as_json(),
        "unfiltered_relative_error": _unfiltered_error(result, trajectories),
        "notes": notes,
        "model": str(model),
        "urdf": None if urdf is None else str(urdf),
        "plot": str(plot),
    }
    tell("done", 1.0)
    return LinksOutcome(result, tuple(trajectories), model, urdf, plot, answer)


def _write_urdf(path: Path, result: LinkIdentification, notes: list[str]) -> Path | None:
    """The arm's URDF with bodies that have the identified base parameters, as near its own bodies as that allows."""
    try:
        found = consistent_parameters(result)
        text = urdf_text(result.body, found.parameters)
    except InputError as error:
        notes.append(f"no URDF was written: {error}")
        return None
    worst = int(np.argmax(np.abs(found.misfit)))
    if abs(found.misfit[worst]) > FAR_OFF:
        notes.append(
            f"no bodies have these parameters quite: in links.urdf {result.base.names[worst]} is "
            f"{abs(found.misfit[worst]):.1f} standard errors off"
        )
    write_atomically(path, text)
    return path


def _unfiltered_error(result: LinkIdentification, trajectories: Sequence[Trajectory]) -> float:
    """100·‖residual‖/‖measured‖ [%] over all joints with the measured torque as it is, its noise included."""
    histories = [torque_history(result, trajectory) for trajectory in trajectories]
    residual = sum(float(np.sum((h.measured - h.predicted) ** 2)) for h in histories)
    return 100.0 * float(np.sqrt(residual / sum(float(np.sum(h.measured**2)) for h in histories)))


def _read(
    request: LinksRequest, tell: Tell
) -> tuple[RigidBody, ArmSource, list[Source], list[Trajectory], list[Trajectory], list[str]]:
    paths = [*request.recordings, *request.hold_out]
    if not request.recordings:
        raise InputError("recordings", "there are none", "give at least one")
    for path in request.hold_out:
        if path.resolve() in {other.resolve() for other in request.recordings}:
            raise InputError(str(path), "is both learnt from and held out", "hold out a recording of its own")
    arm = arm_source(request.arm) if request.arm is not None else None
    body: RigidBody | None = None
    sources: list[Source] = []
    read: list[Trajectory] = []
    notes: list[str] = []
    for k, path in enumerate(paths):
        tell(f"reading {path.name}", 0.4 * k / len(paths))
        recording = read_any(path, arm, request.topic)
        if arm is None:
            arm = _recorded_arm(recording, path)
        if body is None:
            body = arm.rigid_body(recording.joints, request.hold)
        notes += [f"{path.name}: {note}" for note in recording.notes]
        sources.append(source_of(path, recording))
        read.append(trajectory_of(recording, body, str(path)))
    assert arm is not None
    assert body is not None
    if body.held:
        held = ", ".join(f"{name} = {value:g}" for name, value in body.held.items())
        notes.append(f"joints of the URDF that were not recorded are held still: {held}")
    count = len(request.recordings)
    return body, arm, sources[:count], read[:count], read[count:], notes


def _recorded_arm(recording: Recording, path: Path) -> ArmSource:
    if recording.arm is None:
        raise InputError(str(path), "does not say which arm it is of", "name it: --arm NAME, or --arm FILE.urdf")
    if recording.installation is not None and recording.installation.path.is_file():
        return of_installation(recording.installation)
    try:
        return of_installation(load_installation(recording.arm))
    except InputError as error:
        raise InputError(
            str(path), f"is of arm {recording.arm}, which is not configured here ({error.problem})", "name --arm"
        ) from None
