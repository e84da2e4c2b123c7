"""The part of a diagnosis' page about what decides: the next motion, or reading with the drives off, and those that
there were."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from service.reports.link_tables import figure
from service.reports.page import Html, element, section, table

DECIDED = 3.0
"""Nats: rivals that lie farther apart are told apart."""


def open_question(experiment: Mapping[str, Any]) -> list[str]:
    """What would decide: in words; with what it promises, and a motion's file, where it was designed."""
    if experiment["predicted_gap"] is None:
        return [f"{experiment['sentence']}."]
    promise = f" It should tell them apart by {experiment['predicted_gap']:.0f} nats. "
    if experiment["motion"] is None:
        return [f"{experiment['sentence']}.", promise]
    return [f"{experiment['sentence']}.", promise, element("span", f"etude run {experiment['motion']}", of="path")]


def experiments_section(played: Sequence[Mapping[str, Any]]) -> Html:
    """What was played, between which causes, what it promised and what came of it."""
    rows = [
        [
            "drives off" if one["motion"] is None else Path(one["motion"]).stem,
            " · ".join(_rival(rival) for rival in one["between"]),
            figure(one["predicted_gap"]),
            "–" if one["gap"] is None else figure(one["gap"]),
            _told(one["gap"]),
        ]
        for one in played
    ]
    headings = ["motion", "to decide between", "promised [nats]", "came of it", ""]
    caption = element(
        "p", "Nats: by how much the nearest of the others is behind, in all recordings together.", of="caption"
    )
    return section("What was played to decide", table(headings, rows, numbers=(2, 3)), caption)


def _told(gap: float | None) -> str:
    if gap is None:
        return "none of them is left: another cause explains it"
    return "decided" if gap > DECIDED else "still open"


def _rival(rival: Mapping[str, Any]) -> str:
    where = rival["joint"] or (f"{rival['channel']} channel" if rival["channel"] else "arm")
    other = f" and {rival['other']}" if rival["other"] else ""
    return f"{str(rival['effect']).replace('_', ' ')} of {where}{other}"
