"""The campaign's loop: stage, seal, ask, open, judge."""

from __future__ import annotations

import shutil
import tempfile
import time
from pathlib import Path

from benchmarks.campaign.arms import true_arm
from benchmarks.campaign.finding import Finder
from benchmarks.campaign.judging import Judgement, judge
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.scenario import stage
from benchmarks.campaign.sealing import ANSWER, QUESTION, Envelope, Question, found_sealed, seal
from benchmarks.campaign.wire import sealed_over_the_wire

TACHOMETERS = frozenset({"dda"})


def judged(plan: Plan, finder: Finder, kept: Path | None = None, wire: bool = False) -> Judgement:
    """The finder, judged on one scenario. Whatever it raises is raised here.

    ``wire``: played by the daemon and the stand-in arm, instead of on the plant alone. ``kept``: a folder where sealed
    scenarios stay, so that a finder that has changed can be asked again.
    """
    with tempfile.TemporaryDirectory(prefix="etude-campaign-") as name:
        folder = Path(name) if kept is None else kept / (plan.name + "-wire" * wire)
        question, envelope = found_sealed(folder) or _anew(plan, folder, wire)
        begin = time.perf_counter()
        answer = finder(question)
        seconds = time.perf_counter() - begin
        return judge(envelope.open(), answer, seconds)


def _anew(plan: Plan, folder: Path, wire: bool) -> tuple[Question, Envelope]:
    """Whatever an interrupted run left there is no scenario."""
    for part in (QUESTION, ANSWER):
        shutil.rmtree(folder / part, ignore_errors=True)
    return (sealed_over_the_wire if wire else sealed)(plan, folder)


def sealed(plan: Plan, folder: Path) -> tuple[Question, Envelope]:
    """Play the plan's scenario and seal it in ``folder``."""
    (folder / QUESTION).mkdir(parents=True)
    staged = stage(plan, folder / QUESTION)
    return seal(staged, true_arm(plan.arm).joints, plan.arm in TACHOMETERS, folder)
