"""The part of a diagnosis' page that comes first where it has many causes: all of them at a glance, joint by joint."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from estimator.diagnosis.telling.answer import Quantity
from service.diagnosis.sentences import effect_text, quantity_text, share_text
from service.reports.page import Html, badge, element, html, section, table

AT_A_GLANCE = 4
"""Causes that a reader takes in without an overview."""


def overview(findings: Sequence[Mapping[str, Any]]) -> Html:
    """One row a cause, which leads to its card."""
    rows, before = [], ""
    for number, finding in enumerate(findings):
        where = str(finding["joint"] or finding["channel"] or "arm")
        share = finding["share_of_explainable"]
        link = f'<a href="#{anchor(number)}">{html(effect_text(finding["effect"]))}</a>'
        bar = f'<div class="bar"><i class="after" style="width:{100.0 * share:.1f}%"></i></div>'
        rows.append(
            [
                element("b", where if where != before else ""),
                Html(link),
                _first(finding["parameters"]),
                badge(finding["status"]),
                share_text(share),
                Html(bar),
            ]
        )
        before = where
    headings = ["where", "cause", "", "", "explains", "of what can be explained there, beside the others"]
    return section("At a glance", table(headings, rows, numbers=(4,)))


def anchor(number: int) -> str:
    """Of a cause's card."""
    return f"cause-{number + 1}"


def _first(parameters: Mapping[str, Mapping[str, Any]]) -> str:
    """The parameter that a cause is known by."""
    for name, told in parameters.items():
        if isinstance(told["value"], (int, float)):
            error = np.nan if told["standard_error"] is None else told["standard_error"]
            return f"{effect_text(name)} {quantity_text(Quantity(told['value'], error, told['unit']))}"
    return ""
