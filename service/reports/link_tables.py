"""What an identification of links found, as tables for a person. Takes the JSON answer: fresh or read back."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType
from rich.table import Table


def link_report(answer: dict[str, Any]) -> list[RenderableType]:
    """Parameters with their standard errors, joint terms, what cannot be identified, how well the torques fit."""
    parameters = Table("base parameter", "value", "± std. error", "unit", box=None)
    for p in answer["base_parameters"]:
        parameters.add_row(p["name"], figure(p["value"]), figure(p["standard_error"]), p["unit"])
    shown: list[RenderableType] = [
        f"arm {answer['arm']}: {answer['status']}, {answer['samples']} samples, {answer['estimator']}, "
        f"band {answer['band']:.3g} Hz, condition number {answer['condition_number']:.3g}",
        parameters,
    ]
    if answer["effects"]:
        effects = Table("effect", "joint", "parameter", "value", "± std. error", "unit", box=None)
        for e in answer["effects"]:
            effects.add_row(
                e["effect"], e["joint"], e["parameter"], figure(e["value"]), figure(e["standard_error"]), e["unit"]
            )
        shown.append(effects)
    intervals = answer.get("intervals", {})
    if withheld := intervals.get("withheld"):
        shown.append(f"no confidence intervals: {withheld}")
    elif caution := intervals.get("caution"):
        shown.append(f"intervals: {caution}")
    groups = answer["identifiability"]
    shown.append(
        f"{len(groups['alone'])} parameters identifiable alone, {len(groups['combined'])} in combination, "
        f"{len(groups['not'])} not at all ({', '.join(groups['not']) or 'none'})"
    )
    shown += residual_tables(answer)
    urdf = [] if answer["urdf"] is None else [f"URDF: {answer['urdf']}"]
    return [*shown, f"model: {answer['model']}", *urdf, f"plot: {answer['plot']}"]


def residual_tables(answer: dict[str, Any]) -> list[RenderableType]:
    """How well the torques fit, on what was learnt from and on what was held out."""
    shown: list[RenderableType] = [
        _residuals("torque residual", answer["torque_residual"], answer["relative_error"]),
        f"against the unfiltered torque, all joints: {answer['unfiltered_relative_error']:.2f} %",
    ]
    if answer["hold_out"] is not None:
        shown.append(_residuals("on the held-out recordings", answer["hold_out"], answer["hold_out_relative_error"]))
    if others := answer.get("leave_one_out"):
        each = ", ".join(f"{name} {error:.2f} %" for name, error in others.items())
        shown.append(f"each recording predicted from the others: {each}")
    return shown


def _residuals(title: str, residuals: dict[str, dict[str, Any]], relative: float) -> Table:
    table = Table(title, "rms", "noise rms", "unit", "relative", box=None)
    for joint, r in residuals.items():
        table.add_row(joint, figure(r["rms"]), figure(r["noise_rms"]), r["unit"], f"{100 * r['relative']:.2f} %")
    table.add_row("all", "", "", "", f"{relative:.2f} %")
    return table


def figure(value: float | None) -> str:
    """A number for a table; a dash where there is none."""
    return "–" if value is None else f"{value:.4g}"
