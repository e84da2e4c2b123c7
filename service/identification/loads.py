"""Identify a load from recordings: read, estimate, judge it against known loads, keep it and the plot, answer.

The same function serves the command line, in its own process, and the daemon, in a worker process.
"""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

from config import InputError
from driver.recording import Recording
from estimator.loads import (
    LoadEstimate,
    LoadOptions,
    LoadRecording,
    RigidLoad,
    StaticLoad,
    Tare,
    identify_load,
    identify_static_load,
    resting_poses,
    wrench_history,
)
from estimator.loads.layout import Offset
from service.identification.examined import examined_motion
from service.identification.load_file import read_one_load, write_load
from service.identification.load_judgement import judged
from service.identification.load_sources import LoadSources, read_load_sources, tare_of, with_wrench
from service.identification.load_torques import from_torques
from service.identification.request import LOAD_FILE, LoadRequest
from service.reports.load_plot import plot_wrenches

Tell = Callable[[str, float], None]
_SESSION_S = 3600.0
"""Over longer than this no sensor drifts in a straight line."""
_DRIFTS_S = 5.0
"""Below this a drift is no more than an offset."""


@dataclass(frozen=True)
class LoadOutcome:
    """``load`` and everything that was made of it."""

    load: RigidLoad
    answer: dict[str, Any]


def identify(request: LoadRequest, tell: Tell = lambda stage, share: None) -> LoadOutcome:
    """Read, estimate, write the load's file and the plot.

    Raises InputError naming the file for recordings that cannot be used: without a wrench, of another arm or other
    joints, with too little motion.
    """
    if not request.recordings:
        raise InputError("recordings", "there are none", "give at least one")
    learnt = {path.resolve() for path in request.recordings}
    for path, role in [(p, "held out") for p in request.hold_out] + [(p, "without the load") for p in request.without]:
        if path.resolve() in learnt:
            raise InputError(str(path), f"is both learnt from and {role}", "give a recording of its own")
    paths = [*request.recordings, *request.without, *request.tares, *request.hold_out]
    tell("reading", 0.0)
    read = read_load_sources(request, paths)
    tell("estimating", 0.4)
    try:
        request.directory.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(request.directory), f"cannot be made ({error.strerror})", "choose another --out") from None
    found = from_torques(request, read) if request.without else _from_wrenches(request, read)
    tell("writing the load and the plot", 0.9)
    file = request.directory / LOAD_FILE
    write_load(file, read.arm.name, read.frame, found.load, read.sources[: len(request.recordings)])
    answer = {
        "arm": read.arm.name,
        "frame": read.frame,
        "method": "torques" if request.without else "wrench",
        **found.answer,
        **judged(found.load, request),
        "notes": list(read.notes),
        "load_file": str(file),
    }
    tell("done", 1.0)
    return LoadOutcome(found.load, answer)


def _from_wrenches(request: LoadRequest, read: LoadSources) -> LoadOutcome:
    count = len(request.recordings)
    recordings = [with_wrench(read, number) for number in range(count)]
    doubts = examined_motion(read.body, [recording.motion for recording in recordings])
    hand = None if request.hand is None else read_one_load(request.hand)
    tares = [tare_of(read, number, hand) for number in range(count, count + len(request.tares))]
    if request.form == "static":
        return _with_doubts(_static(request, read, recordings, hand, tares), doubts)
    options = LoadOptions(
        form=request.form,
        offset=_offset(read, read.recordings[:count], tares),
        band_hz=request.band_hz,
        sensor_range=read.sensor_range,
    )
    result = identify_load(read.body, read.frame, recordings, hand, tares, options=options)
    plot, hold_out = _judged_on(request, read, recordings, result)
    outcome = LoadOutcome(result.load, {**result.as_json(), "hold_out": hold_out, "plot": str(plot)})
    return _with_doubts(outcome, doubts)


def _with_doubts(outcome: LoadOutcome, doubts: Sequence[str]) -> LoadOutcome:
    warnings = [*outcome.answer["warnings"], *doubts]
    return replace(outcome, answer={**outcome.answer, "warnings": warnings})


def _static(
    request: LoadRequest,
    read: LoadSources,
    recordings: Sequence[LoadRecording],
    hand: RigidLoad | None,
    tares: Sequence[Tare],
) -> LoadOutcome:
    for given, name in ((tares, "--tare"), (request.hold_out, "--hold-out")):
        if given:
            raise InputError(name, "has no use in the static form, whose poses tell the offset", "leave it out")
    poses = resting_poses(recordings)
    drifts = _offset(read, read.recordings, ()) == "drift" and len(poses.q) > 4
    result: StaticLoad = identify_static_load(read.body, read.frame, poses, hand, with_drift=drifts)
    answer = {**result.as_json(), "samples": sum(r.motion.samples for r in recordings), "hold_out": None, "plot": None}
    return LoadOutcome(result.load, answer)


def _offset(read: LoadSources, recordings: Sequence[Recording], tares: Sequence[Tare]) -> Offset:
    """What the sensor's offset is taken to do: drift over a session, stay, or be another in every recording."""
    if not read.dated:
        return "constant" if len(recordings) == 1 or tares else "each"
    begin = min(r.start_ns for r in recordings)
    span = max((r.start_ns - begin) / 1e9 + float(r.t[-1]) for r in recordings)
    if span > _SESSION_S and not tares:
        return "each"
    return "drift" if span > _DRIFTS_S or len(tares) > 1 else "constant"


def _judged_on(
    request: LoadRequest, read: LoadSources, recordings: Sequence[LoadRecording], result: LoadEstimate
) -> tuple[Path, dict[str, Any] | None]:
    """The plot of measured and predicted wrench, of a held-out recording where there is one; and the residuals on
    those."""
    first = len(read.recordings) - len(request.hold_out)
    held_out = [with_wrench(read, number) for number in range(first, len(read.recordings))]
    histories = [wrench_history(read.body, read.frame, result, recording) for recording in held_out]
    shown = histories[0] if held_out else wrench_history(read.body, read.frame, result, recordings[0], 0)
    name = Path((held_out or recordings)[0].motion.name).stem
    plot = request.directory / "wrench.png"
    title = f"{read.arm.name}: wrench of the load in {name}" + (", not learnt from" if held_out else "")
    plot_wrenches(plot, title, shown)
    if not held_out:
        return plot, None
    return plot, {Path(r.motion.name).name: h.residual for r, h in zip(held_out, histories, strict=True)}
