"""Commands on what was recorded: `recordings`, `replay`, `recover`, `export`, `report`. None needs a daemon."""

from __future__ import annotations

from pathlib import Path
from typing import Annotated, Any

import typer
from rich.console import RenderableType
from rich.table import Table

from config import InputError
from config.loader import installation_path
from config.paths import state_directory
from service import outcomes
from service.cli.console import publish
from service.cli.options import ArmOption, JsonOption, OfArmOption, arm_to_ask, require_same_arm
from service.sessions.store import Session, SessionRecord, SessionStore

RecordingArgument = Annotated[Path, typer.Argument(metavar="RECORDING")]


def recordings(arm: ArmOption = None, json: JsonOption = None) -> None:
    """List the recordings of all sessions, oldest first."""
    from service.reports.recording_list import summarise

    entries = [
        {"arm": session.record.arm, "session": session.id, **summarise(session.directory / name)}
        for session in _sessions(arm)
        for name in session.record.recordings
    ]
    table = Table("recording", "session", "seconds", "joint samples", "MB", "", box=None)
    for e in entries:
        seconds = "" if e["seconds"] is None else f"{e['seconds']:.2f}"
        state = "" if e["complete"] else "cut: etude recover"
        table.add_row(e["path"], e["session"], seconds, str(e["samples"] or ""), f"{e['bytes'] / 1e6:.1f}", state)
    publish({"recordings": entries}, json, table if entries else "no session has recorded anything yet")


def replay(recording: RecordingArgument, arm: OfArmOption = None, json: JsonOption = None) -> None:
    """Decode a recording's raw frames again and compare with what was recorded, byte for byte."""
    from driver.recording import replay as replay_file

    _require_arm(recording, arm)
    report = replay_file(recording)
    answer = {
        "recording": str(recording),
        "identical": report.identical,
        "messages": report.messages,
        "differences": [{"topic": d.topic, "message": d.message} for d in report.differences],
    }
    publish(answer, json, report.sentence)
    if not report.identical:
        raise typer.Exit(outcomes.ANSWER_IS_NO)


def recover(
    recording: RecordingArgument,
    out: Annotated[
        Path | None, typer.Option("--out", metavar="FILE", help="Leave the recording as it is and write here.")
    ] = None,
    arm: OfArmOption = None,
    json: JsonOption = None,
) -> None:
    """Give a cut recording its end, so that stock readers read it."""
    from driver.recording import recover as recover_file

    _require_arm(recording, arm)
    report = recover_file(recording, out)
    answer = {
        "recording": str(report.path),
        "complete": report.complete,
        "messages": report.messages,
        "seconds": report.seconds,
        "lost_bytes": report.lost_bytes,
        "damaged": list(report.damaged),
    }
    publish(answer, json, report.sentence)


def export(
    source: Annotated[
        str, typer.Argument(metavar="SOURCE", help="A recording; or a model's file, an arm's name, ARM@VERSION.")
    ],
    output: Annotated[
        Path,
        typer.Argument(metavar="OUTPUT", help=".csv of a recording; .xml, .urdf or .toml of a model."),
    ],
    topic: Annotated[str, typer.Option("--topic", help="JointState topic of a foreign MCAP.")] = "/joint_states",
    arm: OfArmOption = None,
    json: JsonOption = None,
) -> None:
    """Write a recording as CSV (t, q, dq, tau of each joint, and the wrench, in SI units), or a model as MuJoCo's XML,
    as URDF or as TOML; what the format cannot hold is listed."""
    from service.models.export import EXPORTS, export_model

    if output.suffix in EXPORTS:
        from service.models.store import named_model

        model = named_model(source)
        require_same_arm(source, model.arm, arm)
        exported = export_model(model, output)
        shown = [f"wrote {output}", *(f"not in it: {sentence}" for sentence in exported["not_written"])]
        publish({"source": source, **exported}, json, *shown)
        return
    from driver.recording import export as export_file

    _require_arm(Path(source), arm)
    left_out = export_file(Path(source), output, topic)
    answer = {
        "recording": source,
        "csv": str(output),
        "samples_left_out": left_out.samples,
        "quantities_left_out": list(left_out.quantities),
    }
    remarks = [f"{left_out.samples} samples with something missing were left out"] if left_out.samples else []
    remarks += [f"{quantity} was left out: no sample has it" for quantity in left_out.quantities]
    publish(answer, json, "; ".join([f"wrote {output}", *remarks]))


def report(
    session: Annotated[
        str,
        typer.Argument(
            metavar="SESSION|FILE", help="A session's id, 'last', or a kept answer: its JSON file, or its directory."
        ),
    ],
    arm: ArmOption = None,
    json: JsonOption = None,
) -> None:
    """Tell what a session did and found, and make its page; or make the page of a kept answer."""
    from service.reports.page import write_page
    from service.reports.pages import page_of, page_of_file

    kept = Path(session)
    if kept.exists():
        made = page_of_file(kept)
        publish({"page": str(made)}, json, f"page: {made}")
        return
    found = _found(session, arm)
    result = found.result()
    text = None if result is None else page_of(result, found.directory)
    page = None if text is None else found.directory / "report.html"
    if page is not None and text is not None:
        write_page(page, text)
    answer = {
        **found.record.model_dump(mode="json"),
        "directory": str(found.directory),
        "result": result,
        "last_frames": None if found.last_frames is None else str(found.last_frames),
        "next": next_step(found.record),
        "page": None if page is None else str(page),
    }
    publish(answer, json, *_shown(found, result), *([] if page is None else [f"page: {page}"]))


def _shown(session: Session, result: dict[str, Any] | None) -> list[RenderableType]:
    from service.reports.results import result_report

    record = session.record
    lines: list[RenderableType] = [
        f"session {record.id} on arm {record.arm}: {record.state}" + (f": {record.cause}" if record.cause else ""),
        f"started {record.started}" + (f", ended {record.ended}" if record.ended else f"; {record.stage}"),
        *(f"recording: {session.directory / name}" for name in record.recordings),
    ]
    if session.last_frames is not None:
        lines.append(f"the last frames before the stop: {session.last_frames}")
    if (step := next_step(record)) is not None:
        lines.append(step)
    if result is not None:
        lines += result_report(record.kind, result)
    return lines


def next_step(record: SessionRecord) -> str | None:
    """What a person does after a session that did not come to its end; None after one that did."""
    match record.state:
        case "stopped":
            return (
                f"see to the cause; etude reset --arm {record.arm} then acknowledges the stop, without moving the arm"
            )
        case "interrupted":
            return "a recording that was cut is made readable by etude recover; begin the session again"
        case "failed":
            return "see to the cause and begin the session again; a recording that was cut: etude recover"
        case _:
            return None


def _require_arm(recording: Path, arm: str | None) -> None:
    """Raise InputError for a recording of another arm than the one that was named, if one was."""
    from driver.recording import arm_made_with

    if arm and recording.is_file():  # what is none is for the command itself to refuse
        require_same_arm(str(recording), arm_made_with(recording), arm)


def _stores(arm: str | None) -> list[SessionStore]:
    state = state_directory()
    recorded = sorted(path.parent.name for path in state.glob("*/sessions"))
    if arm is None:
        return [SessionStore(state, name) for name in recorded]
    name = arm_to_ask(arm)
    if name == arm and name not in recorded:
        installation_path(name)  # refuses a name that no arm has
    return [SessionStore(state, name)]


def _sessions(arm: str | None) -> list[Session]:
    return [session for store in _stores(arm) for session in store.all()]


def _found(session_id: str, arm: str | None) -> Session:
    everything = _sessions(arm)
    if session_id == "last" and everything:
        return max(everything, key=lambda s: s.record.started)
    for session in everything:
        if session.id == session_id:
            return session
    newest = ", ".join(s.id for s in everything[-3:])
    raise InputError(
        f"session {session_id}",
        "there is no such session",
        f"the newest are {newest}" if newest else "none has run yet",
    )
