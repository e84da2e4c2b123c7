"""Identify links from recordings: read, estimate, keep the model and the plot, answer.

The same function serves the command line, in its own process, and the daemon, in a worker process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from config import InputError
from estimator.consistency import consistent_parameters
from estimator.export import urdf_text
from estimator.identification import LinkIdentification
from estimator.links import LinkOptions, identify_links
from estimator.prediction import torque_history
from estimator.trajectory import Trajectory
from service.identification.read import read_recordings
from service.identification.request import LinksRequest
from service.models.model_file import link_model_file, write_model
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
    read = read_recordings(request.recordings, request.hold_out, request.arm, request.hold, request.topic, tell)
    body, arm, trajectories, hold_out, notes = read.body, read.arm, read.trajectories, read.hold_out, [*read.notes]
    tell("estimating", 0.4)
    options = LinkOptions(estimator=request.estimator, band_hz=request.band_hz)
    result = identify_links(body, trajectories, options, hold_out)
    tell("writing the model and the plot", 0.85)
    try:
        request.directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(request.directory), f"cannot be made ({error.strerror})", "choose another --out") from None
    model = request.directory / "links.toml"
    write_model(model, link_model_file(arm.name, result, read.sources))
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
