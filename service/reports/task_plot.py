"""How a task came out, trial by trial: curves for a file, a table for a person, a page for a browser."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from rich.console import RenderableType
from rich.table import Table

from service.reports.link_tables import figure as shown
from service.reports.page import badge, element, joined, page, picture, section, table
from service.reports.practice_plot import OTHER_COLOURS
from service.reports.style import ACCENT, figure, finish

Answer = Mapping[str, Any]


def plot_task(path: Path, answer: Answer) -> None:
    """Misses over trials beside what chance leaves. Raises InputError when the file cannot be written."""
    fig, axes = figure(1, f"{answer['task']}: misses of the task, by trial")
    axis = axes[0]
    for colour, (name, scatter) in zip((ACCENT, *OTHER_COLOURS), answer["scatter"].items(), strict=False):
        misses = [abs(trial["miss"][name]) for trial in answer["trials"]]
        label = f"{name} [{answer['units'][name]}]"
        axis.semilogy(range(len(misses)), misses, marker="o", ms=3, color=colour, label=label)
        axis.axhline(2.0 * scatter, color=colour, ls="--", lw=0.8)
    axis.set_ylabel("miss\n(dashed: chance)")
    axis.xaxis.get_major_locator().set_params(integer=True)
    axis.set_xlabel("trials; 0: the model's plan, mean of the replays")
    axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    finish(fig, path)


def task_report(answer: Answer) -> list[RenderableType]:
    """Parameters and misses of each trial, for a person."""
    parameters = list(answer["trials"][0]["parameters"])
    misses = [f"miss {name} [{unit}]" for name, unit in answer["units"].items()]
    rows = Table("", *parameters, *misses, box=None)
    for row in _rows(answer):
        rows.add_row(*row)
    return [
        f"{answer['task']} ({answer['kind']}) in {answer['mode']}, by {answer['model']}",
        rows,
        f"stopped because {answer['stopped_because']}",
        f"plot: {answer['plot']}",
    ]


def task_page(answer: Answer) -> str:
    """The page as HTML, from the JSON answer of `practise --task`."""
    last = len(answer["trials"]) - 1
    hit = "cannot be told from chance" in answer["stopped_because"]
    lead = joined(
        [
            badge("good" if hit else "ambiguous", "as wanted" if hit else "not yet as wanted"),
            f"{last} trials after {answer['replays']} replays of the model's plan. Stopped because "
            f"{answer['stopped_because']}.",
        ]
    )
    facts = {name: str(answer[name]) for name in ("arm", "mode", "model", "kind")}
    parameters = list(answer["trials"][0]["parameters"])
    headings = ["", *parameters, *(f"miss {name} [{unit}]" for name, unit in answer["units"].items())]
    sections = [
        section("Misses by trial", picture(Path(answer["plot"]))),
        section("Parameters and misses", table(headings, _rows(answer), numbers=tuple(range(1, len(headings))))),
        section(
            "What this rests on",
            element("ul", *(element("li", element("span", path, of="path")) for path in answer["recordings"])),
        ),
    ]
    return page("Étude · task", f"{answer['task']}, learnt", lead, facts, sections)


def _rows(answer: Answer) -> list[list[str]]:
    rows = []
    for k, trial in enumerate(answer["trials"]):
        name = f"model's plan, {answer['replays']} replays" if k == 0 else f"trial {k}"
        numbers = [*trial["parameters"].values(), *trial["miss"].values()]
        rows.append([name, *(shown(x) for x in numbers)])
    blank = [""] * len(answer["trials"][0]["parameters"])
    rows.append(["chance, one standard deviation", *blank, *(shown(x) for x in answer["scatter"].values())])
    return rows
