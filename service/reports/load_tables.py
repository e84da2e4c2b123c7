"""What an identification of a load found, as tables for a person. Takes the JSON answer: fresh or read back."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

from rich.console import RenderableType
from rich.table import Table

from service.reports.link_tables import figure

QUANTITIES = (
    ("mass", ("mass",)),
    ("centre", ("centre x", "centre y", "centre z")),
    ("inertia", ("Ixx", "Ixy", "Ixz", "Iyy", "Iyz", "Izz")),
    ("principal_moments", ("moment 1", "moment 2", "moment 3")),
)


def load_report(answer: dict[str, Any]) -> list[RenderableType]:
    """The load with its standard errors, the sensor, the residuals, and the judgements that were asked for."""
    parameters = Table("load", "value", "± std. error", "unit", box=None)
    for key, names in QUANTITIES:
        entry = answer[key]
        values, errors = (_flat(entry[part]) for part in ("value", "standard_error"))
        for name, value, error in zip(names, values, errors, strict=True):
            parameters.add_row(name, figure(value), figure(error), entry["unit"])
    for number, (axis, error) in enumerate(
        zip(answer["principal_axes"]["value"], answer["principal_axes"]["standard_error"], strict=True), 1
    ):
        shown = "–" if None in axis else "(" + ", ".join(f"{x:+.3f}" for x in axis) + ")"
        parameters.add_row(f"axis {number}", shown, figure(error), "rad")
    how = {"wrench": "from wrenches", "torques": "from joint torques"}[answer["method"]]
    return [
        f"arm {answer['arm']}, {answer['frame']}: {answer['status']} {how}, {answer['form']}, "
        f"{answer['samples']} samples" + (f", band {answer['band_hz']:.3g} Hz" if answer.get("band_hz") else ""),
        parameters,
        *_residuals(answer),
        *sensor_lines(answer),
        *judgements(answer),
        f"load: {answer['load_file']}",
        *([f"plot: {answer['plot']}"] if answer["plot"] else []),
    ]


def _flat(value: Any) -> list[Any]:
    return value if isinstance(value, list) else [value]


def _residuals(answer: dict[str, Any]) -> list[RenderableType]:
    parts = [
        (answer["wrench_residual"], "wrench residual", "N, N·m"),
        (answer.get("torque_residual"), "torque residual", "N·m"),
    ]
    parts += [(residual, f"on {name}, held out", "N, N·m") for name, residual in (answer["hold_out"] or {}).items()]
    tables: list[RenderableType] = []
    for residuals, title, unit in parts:
        if residuals:
            table = Table(title, f"rms [{unit}]", "relative", box=None)
            for channel, r in residuals.items():
                table.add_row(channel, figure(r["rms"]), f"{100 * r['relative']:.2f} %")
            tables.append(table)
    rigid = answer["rigid"]
    if rigid["p_value"] is not None:
        share = "" if rigid["detectable_share"] is None else f", {100 * rigid['detectable_share']:.1f} % would be seen"
        tables.append(f"{rigid['verdict']}: p = {rigid['p_value']:.2g}, noise from {rigid['noise_from']}{share}")
    return tables


def sensor_lines(answer: Mapping[str, Any]) -> list[RenderableType]:
    """What was found about the sensor itself: its delay, offset and drift."""
    lines: list[RenderableType] = []
    delay = answer["wrench_delay"]
    if delay is not None and delay["value"] is not None:
        error = "" if delay["standard_error"] is None else f" ± {1e3 * delay['standard_error']:.2g}"
        lines.append(f"the sensor is {1e3 * delay['value']:.2f}{error} ms late")
    for key in ("offset", "drift"):
        entry = answer.get(key)
        if entry is not None and any(x not in (None, 0.0) for x in entry["value"]):
            lines.append(f"{key}: " + ", ".join(figure(x) for x in entry["value"]) + f" {entry['unit']}")
    return lines


def judgements(answer: Mapping[str, Any]) -> list[RenderableType]:
    """Whether it is a known load, and the one that was expected."""
    lines: list[RenderableType] = []
    if recognition := answer["recognition"]:
        told = recognition["name"] or "none of the known loads"
        lines.append(
            f"{recognition['verdict']}: {told}; a known load is missed in {100 * recognition['false_rejection']:.2g} % "
            f"of cases, taken for another in {100 * recognition['confusion']:.2g} %"
        )
    if verification := answer["verification"]:
        lines.append(
            f"{verification['verdict']}: {verification['expected']} within {1e3 * verification['mass_tolerance']:g} g "
            f"and {1e3 * verification['centre_tolerance']:g} mm; wrongly accepted in at most "
            f"{100 * verification['false_acceptance']:.2g} %, wrongly rejected in at most "
            f"{100 * verification['false_rejection']:.2g} % of cases"
        )
    return lines
