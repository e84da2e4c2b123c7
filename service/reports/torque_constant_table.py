"""Torque constants in the terminal."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType
from rich.table import Table

from service.answers import finite
from service.reports.link_tables import figure


def torque_constant_report(answer: dict[str, Any]) -> list[RenderableType]:
    """From the JSON answer of `calibrate torque-constant`."""
    if answer["joints"] is None:
        played = " ".join(f"--without {path}" for path in answer["recordings"])
        return [
            f"arm {answer['arm']}: {answer['status']}",
            f"now hang a load on the wrist, and: etude calibrate torque-constant {played}",
        ]
    table = Table(
        "joint", "true / measured", "± std. error", "rated_torque_nm", "± std. error", "load [N·m rms]", box=None
    )
    for joint, found in answer["joints"].items():
        numbers = (found[key][part] for key in ("gain", "rated_torque_nm") for part in ("value", "standard_error"))
        table.add_row(joint, *(figure(finite(x)) for x in numbers), figure(found["load_torque_rms"]))
    return [f"arm {answer['arm']}: {answer['status']}", table]
