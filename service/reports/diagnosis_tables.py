"""A diagnosis on the terminal: the sentences, the alternatives, the residual torques."""

from __future__ import annotations

from typing import Any

from rich.console import RenderableType
from rich.table import Table

from service.diagnosis.sentences import share_text
from service.reports.link_tables import figure


def diagnosis_report(answer: dict[str, Any]) -> list[RenderableType]:
    """From the JSON answer of `diagnose`."""
    shown: list[RenderableType] = _said(answer)
    if answer["findings"]:
        shown.append(_findings(answer["findings"]))
    shown += [
        f"to decide {finding['effect']}: {_experiment(finding['next_experiment'])}"
        for finding in answer["findings"]
        if finding["next_experiment"]
    ]
    shown += [_played(one) for one in answer["experiments"]]
    shown.append(_residuals("torque residual, rms", answer["torque_residual"]))
    if drives := answer.get("drive_residual"):
        shown.append(_residuals("motor less sensor, rms", drives))
    if gears := answer.get("gear_residual"):
        shown.append(_residuals("angle of the motor less that behind the gear, rms", gears))
    held_out = answer["gain"]["held_out_torque"]
    share = held_out["share_of_explainable"]
    explained = "nothing beyond the noise" if share is None else f"{100 * share:.0f} % of what can be explained"
    shown.append(
        f"on data left out, all joints: {figure(held_out['before_rms'])} → {figure(held_out['after_rms'])} "
        f"{held_out['unit']} rms, "
        f"{explained}"
    )
    simulation = answer["gain"]["simulation"]
    if simulation is not None:
        shown.append(
            f"simulated under {simulation['controller']}: angles off by {figure(simulation['position_before_rms'])} → "
            f"{figure(simulation['position_after_rms'])} {simulation['unit']} rms"
        )
    tracking = answer["gain"].get("tracking")
    if tracking is not None:
        before, after = (figure(tracking[key]) for key in ("position_before_rms", "position_after_rms"))
        shown.append(
            f"on the arm, {tracking['motion']} under the model's feedforward: angles off by {before} → {after} "
            f"{tracking['unit']} rms"
        )
    if answer["model"] is not None:
        shown.append(f"model {answer['model_name']}: {answer['model']}")
    return [*shown, f"page: {answer['report']}"] if answer["report"] else shown


def _said(answer: dict[str, Any]) -> list[RenderableType]:
    """The verdict; one line for each cause, the most telling first, and for each joint that keeps something."""
    causes = [str(finding["sentence"]) for finding in answer["findings"]]
    left = [
        f"{joint}: {share_text(one['share'])} of what can be explained there has no name ({one['signature']})"
        for joint, one in answer["unexplained"].items()
    ]
    if len(causes) + len(left) < 2:
        return [f"{answer['verdict']}: {answer['summary']}"]
    counted = f"{len(causes)} cause{'s' * (len(causes) != 1)}" if causes else "no cause has a name"
    lines = [f"{answer['verdict']}: {counted}", *(f"- {cause}" for cause in causes)]
    return [*lines, *([f"left at {len(left)} of {len(answer['torque_residual'])} joints:"] if left else []),
            *(f"- {one}" for one in left)]  # fmt: skip


def _experiment(told: dict[str, Any]) -> str:
    if told["predicted_gap"] is None:
        return str(told["sentence"])
    file = "" if told["motion"] is None else f": {told['motion']}"
    return f"{told['sentence']}{file} (should tell them apart by {told['predicted_gap']:.0f} nats)"


def _played(experiment: dict[str, Any]) -> str:
    rivals = ", ".join(f"{r['effect']} {_where(r)}" for r in experiment["between"])
    off = experiment["motion"] is None
    done = "recorded the torques with the drives off" if off else f"played {experiment['motion']}"
    told = "none of them is left" if experiment["gap"] is None else f"{experiment['gap']:.1f} nats lie between"
    return f"{done} to decide between {rivals}: {told}, {experiment['predicted_gap']:.1f} expected"


def _findings(findings: list[dict[str, Any]]) -> Table:
    table = Table(
        "cause", "where", "status", "evidence [nats]", "false alarm", "nearest alternative", "behind", box=None
    )
    for finding in findings:
        nearest = finding["alternatives"][0] if finding["alternatives"] else None
        table.add_row(
            finding["effect"],
            _where(finding),
            finding["status"],
            f"{finding['evidence']['log_likelihood_gain']:.0f}",
            f"{finding['evidence']['false_alarm_probability']:.1g}",
            "–" if nearest is None else f"{nearest['effect']} {_where(nearest)}",
            "–" if nearest is None else f"{nearest['log_likelihood_gap']:.1f}",
        )
    return table


def _where(place: dict[str, Any]) -> str:
    if place["joint"] is not None and place["channel"] is not None:
        return f"{place['joint']}, {place['channel']}"
    return str(place["joint"] or place["channel"] or "arm")


def _residuals(title: str, residuals: dict[str, dict[str, Any]]) -> Table:
    table = Table(title, "before", "after", "noise", "unit", box=None)
    for joint, r in residuals.items():
        numbers = (figure(r[key]) for key in ("before_rms", "after_rms", "noise_rms"))
        table.add_row(joint, *numbers, r["unit"])
    return table
