"""The page of an identification of a load."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from service.reports.link_tables import figure
from service.reports.load_tables import QUANTITIES, judgements, sensor_lines
from service.reports.page import Html, badge, element, joined, page, picture, section, table

Answer = Mapping[str, Any]
SOUND = ("identified", "ok")


def load_page(answer: Answer) -> str:
    """The page as HTML, from the JSON answer of `identify load`; the plot is taken in where it still is."""
    mass = answer["mass"]
    error = "" if mass["standard_error"] is None else f" ± {figure(mass['standard_error'])}"
    centre = ", ".join(figure(x) for x in answer["centre"]["value"])
    lead = joined(
        [
            badge("good" if answer["status"] in SOUND else "ambiguous", answer["status"]),
            f"It weighs {figure(mass['value'])}{error} kg, its centre at ({centre}) m in {answer['frame']}.",
        ]
    )
    facts = {
        "from": {"wrench": "wrenches", "torques": "joint torques"}[answer["method"]],
        "samples": str(answer["samples"]),
        "band": f"{figure(answer['band_hz'])} Hz" if answer.get("band_hz") else "",
        "rigid": str(answer["rigid"]["verdict"]),
    }
    told = [str(line) for line in [*judgements(answer), *sensor_lines(answer)]]
    plot = picture(Path(answer["plot"])) if answer["plot"] else Html("")
    sections = [
        section("What it is", element("ul", *(element("li", line) for line in told))) if told else Html(""),
        section("Wrench, measured and predicted", plot) if plot else Html(""),
        section("The load", _parameters(answer)),
        *_residuals(answer),
        section("Kept", element("p", str(answer["load_file"]), of="path")) if answer["load_file"] else Html(""),
    ]
    return page("Étude · load", f"What {answer['arm']} carries", lead, facts, sections)


def _parameters(answer: Answer) -> Html:
    rows = []
    for key, names in QUANTITIES:
        entry = answer[key]
        values, errors = ([x] if not isinstance(x, list) else x for x in (entry["value"], entry["standard_error"]))
        rows += [
            [name, figure(value), figure(error), entry["unit"]]
            for name, value, error in zip(names, values, errors, strict=True)
        ]
    return table(["", "value", "± std. error", "unit"], rows, numbers=(1, 2))


def _residuals(answer: Answer) -> list[Html]:
    parts = [
        ("Wrench residual", answer["wrench_residual"]),
        ("Torque residual", answer.get("torque_residual")),
        *((f"On {Path(name).name}, held out", residual) for name, residual in (answer["hold_out"] or {}).items()),
    ]
    return [
        section(
            title,
            table(
                ["channel", "rms [N, N·m]", "relative"],
                [[name, figure(r["rms"]), f"{100 * r['relative']:.2f} %"] for name, r in residual.items()],
                numbers=(1, 2),
            ),
        )
        for title, residual in parts
        if residual
    ]
