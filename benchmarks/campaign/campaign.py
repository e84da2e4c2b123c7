"""The campaign's loop: stage, seal, ask, open, judge."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Iterable, Iterator
from pathlib import Path

from benchmarks.campaign.arms import true_arm
from benchmarks.campaign.finding import Finder
from benchmarks.campaign.judging import Judgement, judge
from benchmarks.campaign.scenario import Plan, stage
from benchmarks.campaign.sealing import seal

TACHOMETERS = frozenset({"dda"})


def run_campaign(plans: Iterable[Plan], finder: Finder) -> Iterator[Judgement]:
    """Judge the finder on every plan, one after the other. Whatever it raises is raised here."""
    for plan in plans:
        with tempfile.TemporaryDirectory(prefix="etude-campaign-") as name:
            folder = Path(name)
            (folder / "question").mkdir()
            staged = stage(plan, folder / "question")
            question, envelope = seal(staged, true_arm(plan.arm).joints, plan.arm in TACHOMETERS, folder)
            begin = time.perf_counter()
            answer = finder(question)
            seconds = time.perf_counter() - begin
            yield judge(envelope.open(), answer, seconds)
