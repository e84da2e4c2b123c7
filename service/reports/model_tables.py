"""Models and their differences as tables."""

from __future__ import annotations

from collections.abc import Mapping
from typing import Any

import numpy as np
from rich.console import RenderableType
from rich.table import Table

from service.models.model_file import EffectEntry, ModelFile, Parameter


def model_report(file: ModelFile) -> list[RenderableType]:
    """One model."""
    lines: list[RenderableType] = [
        f"model of arm {file.arm}, version {file.version}: {file.status}",
        f"address {file.address}",
        f"extends {file.parent}" if file.parent else "extends nothing",
        *(f"learnt from {s.path}: {s.samples} samples, {s.duration_s:.3g} s" for s in file.learnt_from),
    ]
    if file.effect:
        table = Table("effect", "where", "parameters", box=None)
        for entry in file.effect:
            table.add_row(entry.name, entry.where, parameters_text(entry.parameter))
        lines.append(table)
    else:
        lines.append("no effects beside the rigid bodies")
    if file.base_parameter:
        table = Table("base parameter", "value", "standard error", "", box=None)
        for row in file.base_parameter:
            error = "" if row.standard_error is None else f"{row.standard_error:.2g}"
            table.add_row(row.name, f"{row.value:.5g}", error, row.unit)
        lines.append(table)
    return lines


def difference_report(difference: Mapping[str, Any]) -> list[RenderableType]:
    """What `model_difference` found."""
    one, other = difference["from"], difference["to"]
    lines: list[RenderableType] = [
        f"from {one['arm']} version {one['version']} to {other['arm']} version {other['version']}"
        + (", which extends it" if difference["extends"] else "")
    ]
    effects = difference["effects"]
    table = Table("", "effect", "where", "parameters", box=None)
    for sign, entries in (("+", effects["added"]), ("-", effects["removed"])):
        for row in entries:
            entry = EffectEntry.model_validate(row)
            table.add_row(sign, entry.name, entry.where, parameters_text(entry.parameter))
    for row in effects["changed"]:
        before, after = (_parameter(row[key]) for key in ("before", "after"))
        far = row["standard_errors"]
        apart = "" if far is None else f" ({far:.1f} standard errors)"
        table.add_row("~", row["effect"], row["joint"] or "arm", f"{row['parameter']} {before} → {after}{apart}")
    if table.row_count:
        lines.append(table)
    changed = Table("base parameter", "before", "after", "", box=None)
    for row in difference["base_parameters"]:
        changed.add_row(row["name"], f"{row['before']:.5g}", f"{row['after']:.5g}", row["unit"])
    if changed.row_count:
        lines.append(changed)
    return lines if len(lines) > 1 else [*lines, "no difference"]


def parameters_text(parameters: Mapping[str, Parameter]) -> str:
    """``level 0.9 ± 0.1 N·m, …``"""
    return ", ".join(f"{name} {_text(parameter)}" for name, parameter in parameters.items())


def _parameter(row: Mapping[str, Any] | None) -> str:
    return "absent" if row is None else _text(Parameter.model_validate(row))


def _text(parameter: Parameter) -> str:
    values = np.atleast_1d(parameter.value)
    errors = (
        np.full(len(values), np.nan) if parameter.standard_error is None else np.atleast_1d(parameter.standard_error)
    )
    shown = [f"{v:.4g}" + (f" ± {e:.2g}" if np.isfinite(e) else "") for v, e in zip(values, errors, strict=True)]
    text = shown[0] if len(shown) == 1 else f"({', '.join(shown)})"
    return f"{text} {parameter.unit}".replace(" –", "")
