"""The command `check`."""

from __future__ import annotations

from collections import Counter
from dataclasses import asdict

import typer
from rich.table import Table
from rich.text import Text

from service import outcomes
from service.cli.console import publish
from service.cli.options import ArmOption, JsonOption, installation_of

COLOURS = {"ok": "green", "warn": "yellow", "fail": "bold red"}


def check(arm: ArmOption = None, json: JsonOption = None) -> None:
    """Is this installation sound? Looks at everything that can be seen without moving the arm."""
    from service.checks import run_checks

    installation = installation_of(arm)
    findings = list(run_checks(installation))
    counts = Counter(f.verdict for f in findings)
    table = Table("area", "subject", "", "finding", "remedy", box=None)
    for f in findings:
        table.add_row(f.area, f.subject, Text(f.verdict, COLOURS[f.verdict]), f.detail, f.remedy)
    sound = counts["fail"] == 0
    verdict = "sound" if sound else "not sound"
    answer = {"arm": installation.arm.name, "verdict": verdict, "findings": [asdict(f) for f in findings]}
    tally = f"{counts['ok']} ok, {counts['warn']} warnings, {counts['fail']} failures"
    publish(answer, json, table, f"arm {installation.arm.name} is {verdict}: {tally}")
    if not sound:
        raise typer.Exit(outcomes.ANSWER_IS_NO)
