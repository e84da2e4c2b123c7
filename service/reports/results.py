"""The result of a session in the terminal, by its kind."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType

from service.practice.answers import practice_report
from service.reports.controller_plot import controller_report
from service.reports.diagnosis_tables import diagnosis_report
from service.reports.link_tables import link_report
from service.reports.load_tables import load_report
from service.reports.task_plot import task_report
from service.reports.torque_constant_table import torque_constant_report
from service.sessions.store import Kind


def result_report(kind: Kind, result: dict[str, Any]) -> list[RenderableType]:
    """From the JSON answer that the session kept."""
    match kind:
        case "identify-links":
            return link_report(result)
        case "identify-load":
            return load_report(result)
        case "calibrate-torque-constant":
            return torque_constant_report(result)
        case "diagnose":
            return diagnosis_report(result)
        case "practise":
            return practice_report(result)
        case "learn-task":
            return task_report(result)
        case "compare-controllers":
            return controller_report(result)
        case "run":
            return [
                f"{joint}: " + ", ".join(f"{k} {v:.4g}" for k, v in error.items() if v is not None)
                for joint, error in result["tracking_error"].items()
            ]
