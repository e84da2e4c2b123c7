"""`etude demo`: stand-in arm and daemon as processes; the thesis' motions over the bus, the links identified and
compared, a motion practised, what the model lacks named.

The same commands do each step alone: etude up --virtual --lockstep, etude identify links, practise, diagnose.
"""

from __future__ import annotations

import os
import tempfile
from collections.abc import Iterator
from contextlib import ExitStack, contextmanager
from pathlib import Path
from typing import Any

from rich.console import RenderableType

from config import InputError, load_installation
from service.cli.console import progress, say
from service.daemon.client import DaemonClient
from service.demo.real_arm import identify_real_arm
from service.demo.thesis_tables import beside_the_tables, comparison_table
from service.diagnosis.diagnosing import diagnose_recordings
from service.diagnosis.request import DiagnoseRequest
from service.identification.links import LinksOutcome, identify
from service.identification.request import LinksRequest
from service.outcomes import ArmStopped
from service.practice.answers import practice_report
from service.reports.diagnosis_tables import diagnosis_report
from service.reports.link_tables import residual_tables
from service.supervision import StartFailed, SupervisedProcess

ARM = "dda"
PRACTISED = "dda-practice"
"""Table 6.1's motion: nothing of it is in the three that are learnt from."""
HELD_OUT = (PRACTISED,)
TRIALS = 3
READY_TIMEOUT_S = 60.0


def tell_story(out: Path, *, lockstep: bool) -> tuple[dict[str, Any], list[RenderableType]]:
    """The whole story; everything it leaves is under ``out``. Returns the answer, and what to show of it.

    Raises InputError when ``out`` cannot be made, ArmStopped when a process fails or the arm stops.
    """
    try:
        out.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise InputError(str(out), f"cannot be made ({error.strerror})", "choose another --out") from None
    say(f"1. the {ARM} stand-in arm and the daemon come up as processes of their own")
    with _brought_up(out, lockstep=lockstep) as run:
        say("2. the thesis' three identification motions, and one to be judged on, go over the CAN bus to the drives")
        with DaemonClient(run, ARM) as daemon, progress() as tell:
            try:
                session = daemon.call(
                    "identify_links",
                    {"hold_out_motions": list(HELD_OUT)},
                    lambda news: tell(news["stage"], news["share"]) if news["stage"] else None,
                )
            except (ArmStopped, InputError) as stop:
                slow = None if lockstep else too_slow(daemon.call("status"), str(stop))
                if slow is None:
                    raise
                raise ArmStopped(slow) from None
        say("3. the links are identified from the recordings")
        outcome = _identified(session, out)
        for note in outcome.answer["notes"]:
            say(f"   {note}")
        say("4. with the identified model the arm practises another motion")
        with DaemonClient(run, ARM) as daemon, progress() as tell:
            practice = daemon.call(
                "practise",
                {"motion": PRACTISED, "model": str(outcome.model), "trials": TRIALS},
                lambda news: tell(news["stage"], news["share"]) if news["stage"] else None,
            )
    rows = beside_the_tables(outcome.result)
    say("5. what the CAD model gets wrong is given its causes")
    diagnosis = _diagnosed(session, out)
    say("6. the same identification on a recording of a real arm")
    real = identify_real_arm(out)
    shown: list[RenderableType] = [comparison_table(rows), *residual_tables(outcome.answer)]
    shown += ["", "Practice of the motion of Table 6.1, with the identified model", *practice_report(practice)]
    shown += ["", "What the CAD model of the arm gets wrong", *diagnosis_report(diagnosis), *real.shown]
    shown += _places(session, outcome, real.answer)
    answer = {
        "links": outcome.answer,
        "beside_the_thesis": rows,
        "practice": practice,
        "diagnosis": diagnosis,
        "real_arm": real.answer,
        "recordings": session["recordings"],
        "session": session["session"],
        "out": str(out),
    }
    return answer, shown


def too_slow(status: dict[str, Any], stop: str) -> str | None:
    """Why a demo in wall-clock time stopped, where its loop missed deadlines: the stand-in arm itself is in order.

    None when no cycle was missed, and the cause ``stop`` is the whole story.
    """
    if not status["missed"]:
        return None
    return (
        f"this machine was too slow to keep {load_installation(ARM).cycle.rate_hz:g} Hz in wall-clock time: "
        f"{status['missed']} of {status['cycles']} cycles were skipped or lacked feedback ({stop}); "
        "close other programs, or leave out --realtime"
    )


def _identified(session: dict[str, Any], out: Path) -> LinksOutcome:
    """From the recordings alone, as `etude identify links RECORDING…` does: the answer must not need the daemon."""
    learnt, held_out = _split(session)
    return identify(LinksRequest(learnt, out, hold_out=held_out, arm=ARM))


def _split(session: dict[str, Any]) -> tuple[tuple[Path, ...], tuple[Path, ...]]:
    """Recordings to learn from, and those that are held out."""
    recordings = tuple(Path(path) for path in session["recordings"])
    return recordings[: -len(HELD_OUT)], recordings[-len(HELD_OUT) :]


def _diagnosed(session: dict[str, Any], out: Path) -> dict[str, Any]:
    """The CAD model against the same recordings: what it gets wrong, by its causes."""
    learnt, held_out = _split(session)
    return diagnose_recordings(DiagnoseRequest(learnt, held_out, ARM, directory=out / "diagnosis")).answer


@contextmanager
def _brought_up(out: Path, *, lockstep: bool) -> Iterator[Path]:
    """The stand-in arm and the daemon, ready; yields their run directory. Both are ended in order afterwards."""
    installation = load_installation(ARM)
    time = ["--lockstep"] if lockstep else []
    with ExitStack() as stack:
        # Sockets need a short path, which ``out`` need not be.
        run = Path(stack.enter_context(tempfile.TemporaryDirectory(prefix="etude-demo-")))
        log = stack.enter_context((out / "processes.log").open("wb"))
        environment = {"ETUDE_RUN": str(run), "ETUDE_STATE": str(out)}
        for name in ("virtual", "daemon"):
            process = SupervisedProcess(
                [name, "--config", str(installation.path), *time], environment, log=log.fileno()
            )
            stack.callback(process.stop)
            try:
                process.wait_ready(READY_TIMEOUT_S)
            except StartFailed as failure:
                log.flush()
                last = (out / "processes.log").read_text(errors="replace").strip().splitlines()[-1:]
                raise ArmStopped(f"{failure}: {''.join(last) or 'it said nothing'}") from None
            say(f"   etude {name}: ready, process {process.process.pid}")
        yield run


def _places(session: dict[str, Any], outcome: LinksOutcome, real: dict[str, Any] | None) -> list[RenderableType]:
    relative = os.path.relpath
    lines: list[RenderableType] = ["", "Everything is kept; diagnosis/report.html is a page to read:"]
    lines += [f"  recording  {relative(path)}" for path in session["recordings"]]
    for answer in (outcome.answer, *([real] if real else [])):
        lines += [f"  {what:<9}  {relative(answer[what])}" for what in ("model", "urdf", "plot") if answer[what]]
    lines += [
        "The recordings open as they are in Foxglove, PlotJuggler and ros2 bag.",
    ]
    return lines
