"""`make campaign`: many sealed scenarios, the finder's answer to each, and the figures that come of them."""

from __future__ import annotations

import argparse
import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict, replace
from functools import partial
from pathlib import Path
from typing import Any

from rich.console import Console
from rich.table import Table

from benchmarks.campaign.arms import ARMS
from benchmarks.campaign.campaign import judged
from benchmarks.campaign.experiments import decided, experiment_figures
from benchmarks.campaign.finding import by_command, in_process
from benchmarks.campaign.judging import Judgement
from benchmarks.campaign.plans import ALL, CATALOGUE, Plan, draw_plans
from benchmarks.campaign.tally import CampaignFigure, mistaken, tally


def main() -> int:
    options = _options()
    if options.experiments:
        return _experiments(options)
    plans = [plan for seed in options.seed for plan in draw_plans(options.scenarios, seed)]
    if options.kind:
        plans = [Plan(plan.number, plan.seed, plan.arm, (options.kind,), options.size, plan.scatter) for plan in plans]
    plans = [replace(plan, **_alike(options)) for plan in plans]
    results: list[Judgement] = []
    finder = by_command if options.command else in_process
    with ProcessPoolExecutor(options.processes) as pool:
        for judgement in pool.map(partial(judged, finder=finder, kept=options.keep, wire=options.wire), plans):
            results.append(judgement)
            mark = "✗" if judgement.wrong else " "
            print(f"{mark} {judgement.sentence} [{judgement.seconds:.1f} s]", file=sys.stderr, flush=True)
    figures = tally(results)
    _print(figures, results)
    if options.json:
        options.json.write_text(json.dumps([asdict(f) for f in figures], indent=1, ensure_ascii=False) + "\n")
    return 0


def _alike(options: argparse.Namespace) -> dict[str, Any]:
    """What all plans have."""
    return {
        "seconds": options.seconds,
        "friction": options.friction,
        "rests": options.rests,
        "drives_off_s": options.drives_off,
    }


def _experiments(options: argparse.Namespace) -> int:
    """Of ``--experiments`` scenarios with one cause each, what designed motions decide of the ambiguous ones."""
    drawn = [plan for seed in options.seed for plan in draw_plans(4 * options.experiments, seed)]
    plans = [plan for plan in drawn if len(plan.kinds) == 1 and plan.kinds[0] in CATALOGUE][: options.experiments]
    if options.arm:
        plans = [replace(plan, arm=options.arm) for plan in plans]
    plans = [replace(plan, **_alike(options)) for plan in plans]
    cases = []
    with ProcessPoolExecutor(options.processes) as pool:
        for plan, case in zip(plans, pool.map(decided, plans), strict=True):
            said = f"{plan.number:4d} {plan.arm} {plan.kinds[0]} at {plan.size:g}: not ambiguous"
            if case is not None:
                cases.append(case)
                gaps = ", ".join(
                    f"{m.predicted_gap:.0f} → {m.gap if m.gap is None else round(m.gap)}" for m in case.motions
                )
                said = f"{case.last.sentence} ({'decided' if case.resolved else 'open'}; nats {gaps or 'no motion'})"
            print(said, file=sys.stderr, flush=True)
    _print(experiment_figures(cases), [])
    return 0


def _options() -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="python -m benchmarks.campaign", description=__doc__)
    parser.add_argument("--scenarios", type=int, default=200, help="how many of each seed (200)")
    parser.add_argument(
        "--seed", type=int, nargs="+", default=[1], help="of every draw; several are tallied as one (1)"
    )
    parser.add_argument("--processes", type=int, default=2, help="at the same time (2)")
    parser.add_argument("--kind", choices=sorted(ALL), help="this cause alone, on every arm in turn")
    parser.add_argument("--arm", choices=ARMS, help="with --experiments: this arm alone")
    parser.add_argument("--size", type=float, default=1.0, help="of --kind, in multiples of the noise (1)")
    parser.add_argument("--friction", type=float, default=0.0, help="of every joint beside the causes, likewise (0)")
    parser.add_argument("--rests", action="store_true", help="motions from point to point, with rests between")
    parser.add_argument(
        "--drives-off", type=float, default=0.0, metavar="S", help="record them at rest too, for so long (0)"
    )
    parser.add_argument("--command", action="store_true", help="ask `etude diagnose` as a command, in its own process")
    parser.add_argument("--wire", action="store_true", help="play over the wire, by the daemon and the stand-in arm")
    parser.add_argument("--seconds", type=float, default=60.0, help="of motion to learn from (60)")
    parser.add_argument("--experiments", type=int, default=0, metavar="N", help="so many cases for designed motions")
    parser.add_argument("--keep", type=Path, help="keep sealed scenarios here, and take those that are there")
    parser.add_argument("--json", type=Path, help="write the figures here too")
    options = parser.parse_args()
    if options.drives_off and (options.wire or options.experiments):
        parser.error("--drives-off goes with neither --wire nor --experiments, where a session reads them itself")
    return options


def _print(figures: Sequence[CampaignFigure], judged: Sequence[Judgement]) -> None:
    console = Console(width=130)
    table = Table("figure", "value", "95 % interval", "cases", "goal", box=None)
    for f in figures:
        interval = "" if f.interval is None or not f.count else f"{f.interval[0]:.2f} to {f.interval[1]:.2f}"
        goal = "" if f.goal is None else f"{'≤' if f.at_most else '≥'} {f.goal:g}"
        reached = {True: " reached", False: " missed", None: ""}[f.reached]
        table.add_row(f.name, f"{f.value:.3g}" if f.count else "–", interval, str(f.count), goal + reached)
    console.print(table)
    confusions = Table("what it was", "what it was named", "times", box=None)
    for truth, name, count in mistaken(judged):
        confusions.add_row(truth, name, str(count))
    if confusions.row_count:
        console.print(confusions)


if __name__ == "__main__":
    sys.exit(main())
