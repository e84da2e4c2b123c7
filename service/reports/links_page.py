"""The page of an identification of links."""

from __future__ import annotations

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from service.reports.link_tables import figure
from service.reports.page import Html, badge, element, folded, joined, page, picture, section, table

Answer = Mapping[str, Any]
SOUND = ("identified", "ok")


def links_page(answer: Answer) -> str:
    """The page as HTML, from the JSON answer of `identify links`; the plot is taken in where it still is."""
    groups = answer["identifiability"]
    held_out = answer["hold_out"] is not None
    relative = answer["hold_out_relative_error"] if held_out else answer["relative_error"]
    where = "on motion that was not learnt from" if held_out else "on the motion that it was learnt from"
    lead = joined(
        [
            badge("good" if answer["status"] in SOUND else "ambiguous", answer["status"]),
            f"The model predicts the joint torques to {figure(relative)} % {where}.",
        ]
    )
    facts = {
        "samples": str(answer["samples"]),
        "estimator": str(answer["estimator"]),
        "band": f"{figure(answer['band'])} Hz",
        "condition number": figure(answer["condition_number"]),
    }
    sections = [
        section("Torques, measured and predicted", picture(Path(answer["plot"]))),
        _residuals(answer),
        section("Base parameters", _parameters(answer)),
        _effects(answer),
        section(
            "What these motions can tell",
            element(
                "p",
                f"{len(groups['alone'])} parameters are identifiable alone, {len(groups['combined'])} in combination, "
                f"{len(groups['not'])} not at all.",
            ),
            folded("Not identifiable", element("p", ", ".join(groups["not"]) or "none")),
        ),
        _files(answer),
    ]
    return page("Étude · links", f"What the links of {answer['arm']} weigh", lead, facts, sections)


def _residuals(answer: Answer) -> Html:
    parts: list[str] = [_residual_table(answer["torque_residual"])]
    if answer["hold_out"] is not None:
        parts += [element("h2", "On motion that was not learnt from"), _residual_table(answer["hold_out"])]
    return section("Torque residual", *parts)


def _residual_table(residuals: Mapping[str, Mapping[str, Any]]) -> Html:
    rows = [
        [joint, figure(r["rms"]), f"{100 * r['relative']:.2f} %", figure(r["noise_rms"]), r["unit"]]
        for joint, r in residuals.items()
    ]
    return table(["joint", "rms", "of the torque", "noise rms", "unit"], rows, numbers=(1, 2, 3))


def _parameters(answer: Answer) -> Html:
    rows = [[p["name"], figure(p["value"]), figure(p["standard_error"]), p["unit"]] for p in answer["base_parameters"]]
    return table(["base parameter", "value", "± std. error", "unit"], rows, numbers=(1, 2))


def _effects(answer: Answer) -> Html:
    if not answer["effects"]:
        return Html("")
    rows = [
        [e["effect"].replace("_", " "), e["joint"], e["parameter"], figure(e["value"]), figure(e["standard_error"]),
         e["unit"]]
        for e in answer["effects"]
    ]  # fmt: skip
    headings = ["effect", "joint", "parameter", "value", "± std. error", "unit"]
    return section("Terms of the joints", table(headings, rows, numbers=(3, 4)))


def _files(answer: Answer) -> Html:
    items = [element("li", note) for note in [*answer["notes"], *answer["warnings"]]]
    items += [
        element("li", f"{what}: ", element("span", str(answer[what]), of="path"))
        for what in ("model", "urdf")
        if answer[what]
    ]
    return section("What this rests on", element("ul", *items))
