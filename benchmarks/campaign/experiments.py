"""How often one or two designed motions decide what recordings leave ambiguous: staged, designed and played on the
plant, in a closed loop with the diagnosis."""

from __future__ import annotations

import tempfile
import time
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from benchmarks.campaign.arms import true_arm
from benchmarks.campaign.campaign import TACHOMETERS
from benchmarks.campaign.finding import TOPIC
from benchmarks.campaign.judging import Judgement, judge, undecided
from benchmarks.campaign.motions import RATE_HZ, REST_S, Playlist
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.playing import Run, as_recorded, play, read_off
from benchmarks.campaign.scenario import Prepared, prepare
from benchmarks.campaign.sealing import HELD_OUT, write_run
from benchmarks.campaign.tally import CampaignFigure, wilson
from config.motion import SampledMotion
from config.motion.curves import RestToRest
from estimator.diagnosis.deciding.experiment import Experiment, design_experiment
from estimator.diagnosis.deciding.experiment_motions import ExperimentMotion
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis, Finding
from service.answers import finite
from service.diagnosis.experimenting import between, realised_gap
from service.diagnosis.json_answer import as_json
from service.identification.designed_motion import limits_of
from service.identification.read import ReadRecordings, read_recordings

BUDGET = 2
_APPROACH_S = 4.0


@dataclass(frozen=True)
class Played:
    """One designed motion: nats promised between the worst pair of rivals, and nats that lie between the found one
    and its nearest rival afterwards (None: none of them was found any more)."""

    predicted_gap: float
    gap: float | None


@dataclass(frozen=True)
class Decided:
    """One scenario that was ambiguous at first. ``last`` judges the answer after all motions; ``told_beyond``: it was
    said that no motion decides what is left."""

    last: Judgement
    motions: tuple[Played, ...]
    resolved: bool
    told_beyond: bool

    @property
    def rightly(self) -> bool:
        return self.resolved and not self.last.wrong


def decided(plan: Plan, budget: int = BUDGET) -> Decided | None:
    """Stage a scenario, diagnose, play designed motions while something is ambiguous; None when nothing ever was."""
    with tempfile.TemporaryDirectory(prefix="etude-campaign-") as name:
        folder = Path(name)
        prepared = prepare(plan, folder / "arm.urdf")
        first = play(prepared.installation, prepared.hidden, prepared.playlist, prepared.seed)
        files = _written([run for run in first if not run.motion.startswith(HELD_OUT)], plan, prepared, folder, 0)
        drives_off: list[Path] = []
        begin = time.perf_counter()
        read, found = _diagnosed(files, drives_off, folder)
        answer = finite(as_json(found, read.notes))
        if not undecided(prepared.truth, answer):
            return None
        motions: list[Played] = []
        left, designs = budget, _designs(found, read, prepared)
        while (chosen := _chosen(designs, left, may_read=not drives_off)) is not None:
            experiment, rivals = chosen
            left -= experiment.motion is not None
            if experiment.drives_off_s is not None:
                seconds = experiment.drives_off_s
                off = read_off(prepared.installation, prepared.hidden, seconds, prepared.seed + len(motions) + 1)
                drives_off = _written([off], plan, prepared, folder, len(files) + len(drives_off))
            elif experiment.motion is not None:
                runs = _played(experiment.motion, experiment.playings, prepared, len(motions) + 1)
                files += _written(runs, plan, prepared, folder, len(files) + len(drives_off))
            read, found = _diagnosed(files, drives_off, folder)
            answer = finite(as_json(found, read.notes))
            motions.append(Played(experiment.predicted_gap, realised_gap(found, rivals)))
            designs = _designs(found, read, prepared)
        judgement = judge(prepared.truth, answer, time.perf_counter() - begin)
        resolved = not undecided(prepared.truth, answer)
        return Decided(judgement, tuple(motions), resolved, not resolved and not designs)


def experiment_figures(cases: Sequence[Decided]) -> list[CampaignFigure]:
    """What the study says."""
    resolved, right = sum(case.resolved for case in cases), sum(case.rightly for case in cases)
    beyond, count = sum(case.told_beyond for case in cases), len(cases)
    ratios = [m.gap / m.predicted_gap for case in cases for m in case.motions if m.gap is not None]

    def share(hits: int) -> float:
        return hits / count if count else float("nan")

    return [
        CampaignFigure("experiments resolve", share(resolved), count, wilson(resolved, count), 0.95),
        CampaignFigure("experiments resolve, nothing wrong named", share(right), count, wilson(right, count)),
        CampaignFigure("said that no motion decides", share(beyond), count, wilson(beyond, count)),
        CampaignFigure(
            "gap after a designed motion / promised for the worst pair, median",
            float(np.median(ratios)) if ratios else float("nan"),
            len(ratios),
        ),
    ]


def _ambiguous(found: Diagnosis) -> list[Finding]:
    return [finding for finding in found.findings if finding.contest is not None]


def _diagnosed(files: Sequence[Path], drives_off: Sequence[Path], folder: Path) -> tuple[ReadRecordings, Diagnosis]:
    urdf = str(folder / "arm.urdf")
    read = read_recordings(files, (), urdf, {}, TOPIC, lambda stage, share: None, drives_off=drives_off)
    return read, diagnose(read.body, read.trajectories, drives_off=read.drives_off)


Design = tuple[Experiment, list[dict[str, object]]]
"""A motion or a reading, and the rivals that it is to tell apart."""


def _designs(found: Diagnosis, read: ReadRecordings, prepared: Prepared) -> list[Design]:
    """Of each ambiguous finding of which something promises to decide."""
    limits = limits_of(prepared.installation, read.body)
    home = np.array(prepared.installation.arm.home_rad)
    designed = []
    for finding in _ambiguous(found):
        assert finding.contest is not None
        if (experiment := design_experiment(finding.contest, limits, home)) is not None:
            designed.append((experiment, between(finding, found.joints)))
    return designed


def _chosen(designs: Sequence[Design], left: int, may_read: bool) -> Design | None:
    """That which promises most, as a session chooses it: a motion while some are ``left``, or a reading."""
    allowed = [one for one in designs if (left > 0 if one[0].motion is not None else may_read)]
    return max(allowed, key=lambda one: one[0].predicted_gap, default=None)


def _played(motion: ExperimentMotion, playings: int, prepared: Prepared, number: int) -> list[Run]:
    """The motion played on the plant, from home to its start before each playing."""
    home = np.array(prepared.installation.arm.home_rad)
    t, q, dq, ddq = motion.sampled(RATE_HZ)
    rest = round(REST_S * RATE_HZ)
    pad = ((rest, rest), (0, 0))
    there = SampledMotion(
        np.arange(len(t) + 2 * rest) / RATE_HZ,
        np.pad(q, pad, mode="edge"), np.pad(dq, pad), np.pad(ddq, pad), f"experiment-{number}",
    )  # fmt: skip
    motions = {"experiment": there, "to": _way(home, q[0], "to"), "back": _way(q[-1], q[0], "back")}
    order = ("to", "experiment", *("back", "experiment") * (playings - 1))
    runs = play(prepared.installation, prepared.hidden, Playlist(motions, order), prepared.seed + number)
    return [run for run in runs if run.motion == "experiment"]


def _way(begin: np.ndarray, end: np.ndarray, name: str) -> SampledMotion:
    t = np.arange(round(_APPROACH_S * RATE_HZ) + 1) / RATE_HZ
    return SampledMotion(t, *RestToRest(np.array([begin, end]), [_APPROACH_S], 5).evaluate(t), name)


def _written(runs: Sequence[Run], plan: Plan, prepared: Prepared, folder: Path, before: int) -> list[Path]:
    rng = np.random.default_rng([prepared.seed, 1, before])
    paths = []
    for number, run in enumerate(runs, before + 1):
        paths.append(folder / f"run-{number:02d}.csv")
        recorded = as_recorded(run, prepared.installation, rng, prepared.every, prepared.jitter_s)
        write_run(recorded, true_arm(plan.arm).joints, plan.arm in TACHOMETERS, paths[-1])
    return paths
