"""Answers of `etude certify` and `etude practise`, for JSON and for a person."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray
from rich.console import RenderableType
from rich.table import Table

from learner.practice import Practice
from service.practice.course import Course
from service.practice.held_joints import held_answer
from service.practice.trials import ActuationLag

Array = NDArray[np.float64]
SHOWN_GAINS = 12


def certificate_answer(found: Course) -> dict[str, Any]:
    """The answer of `etude certify`."""
    return {
        "motion": found.practised.name,
        "arm": found.practised.installation.arm.name,
        "mode": found.practised.mode,
        "model": found.model.source,
        **found.certificate.as_json(),
        **held_answer(found, _counting(found), "what its encoder's counts leave"),
    }


def _counting(found: Course) -> Array:
    """(n,) rad/s that encoders' counts alone leave of a perfect trial; 0 where velocities are measured, or nothing is
    to be learnt."""
    reference = found.practised.reference
    if not found.certificate.admitted:
        return np.zeros(reference.n)
    powers = [trial.velocity_error_rms(reference) ** 2 for trial in found.as_counted()]
    return np.asarray(np.sqrt(np.mean(powers, axis=0)))


def certificate_report(answer: dict[str, Any]) -> list[RenderableType]:
    """The certificate for a person."""
    table = Table("frequency [Hz]", "gain of an error from trial to trial", box=None)
    gains = answer["gain"]
    for k in np.unique(np.linspace(0, len(gains) - 1, SHOWN_GAINS).astype(int)):
        table.add_row(f"{gains[k]['frequency']:.3g}", f"{gains[k]['spectral_radius']:.3g}")
    header = (
        f"{answer['operator']} operator on {answer['motion']} ({answer['mode']}), by {answer['model']}: "
        f"{answer['verdict']}"
    )
    if answer["finite_interval"]["norm"] is None:
        return [header, answer["reason"]]
    return [
        header,
        answer["reason"],
        table,
        f"learning bandwidth {answer['learning_bandwidth']:.3g} Hz; used up to {answer['band_hz']:.3g} Hz; a trial "
        f"leaves {100 * answer['expected_error_ratio']:.3g} % of the command's error",
        f"over the motion's samples, were the model exact: growth in one trial at most "
        f"{answer['finite_interval']['norm']:.3g}, greatest eigenvalue without band limit "
        f"{answer['finite_interval']['eigenvalue']:.3g}",
        *answer["held_joints"],
    ]


def practice_answer(
    found: Course, practice: Practice, names: tuple[str, ...], stopped_because: str, lag: ActuationLag
) -> dict[str, Any]:
    """The answer of `etude practise`; the first of ``trials`` is the model's feedforward, over all replays."""

    def by_joint(values: Array) -> dict[str, float]:
        return {name: float(x) for name, x in zip(names, values, strict=True)}

    return {
        "motion": found.practised.name,
        "arm": found.practised.installation.arm.name,
        "mode": found.practised.mode,
        "model": found.model.source,
        "operator": found.operator.name,
        "replays": practice.repeatability.replays,
        "repeatability": by_joint(practice.repeatability.velocity),
        "counting": by_joint(practice.repeatability.counting),
        "indistinguishable_below": by_joint(practice.repeatability.bound),
        "actuation_lag_cycles": by_joint(lag.cycles),
        "unexplained_torque_rms": by_joint(lag.residual),
        "trials": [
            {
                "velocity_error_rms": by_joint(lesson.velocity_error_rms),
                "position_error_peak": by_joint(lesson.position_error_peak),
                "slow_share": by_joint(lesson.slow_share),
                "predicted_rms": by_joint(lesson.predicted_rms),
                "learnt": lesson.learnt,
                "findings": list(lesson.findings),
            }
            for lesson in practice.lessons
        ],
        "certificate": found.certificate.as_json(),
        **held_answer(found, practice.repeatability.velocity, "repeatability"),
        "stopped_because": stopped_because,
    }


def practice_report(answer: dict[str, Any]) -> list[RenderableType]:
    """Each trial's error beside repeatability, for a person."""
    joints = list(answer["repeatability"])
    table = Table("velocity error, RMS [rad/s]", *joints, "× repeatability", "", box=None)
    for k, trial in enumerate(answer["trials"]):
        errors = trial["velocity_error_rms"]
        worst = max(errors[j] / answer["repeatability"][j] for j in joints)
        name = f"model's feedforward, {answer['replays']} replays" if k == 0 else f"trial {k}"
        table.add_row(name, *(f"{errors[j]:.4g}" for j in joints), f"{worst:.2f}", "; ".join(trial["findings"]))
    table.add_row("repeatability", *(f"{answer['repeatability'][j]:.4g}" for j in joints), "1.00", "")
    if any(answer["counting"].values()):
        table.add_row("of it by encoders' counts", *(f"{answer['counting'][j]:.4g}" for j in joints), "", "")
    certificate = answer["certificate"]
    return [
        f"{answer['motion']} in {answer['mode']}, {answer['operator']} operator, by {answer['model']}",
        f"certificate: {certificate['verdict']}, {certificate['reason']}",
        table,
        *answer.get("held_joints", []),
        f"stopped because {answer['stopped_because']}",
        *(f"taught: {taught_text(one)}" for one in answer.get("taught", [])),
        *(f"{what}: {answer[what]}" for what in ("feedforward", "plot") if answer.get(what)),
    ]


def taught_text(effect: dict[str, Any]) -> str:
    """One effect that practice has taught, in words."""
    numbers = ", ".join(f"{name} {value:.4g}" for name, value in effect["parameters"].items())
    return f"{effect['effect']} at {effect['joint']}, {numbers}"


def ratio_text(practice: Practice) -> str:
    """How far the last trial is from repeatability."""
    ratio = float(np.max(practice.lessons[-1].velocity_error_rms / practice.repeatability.velocity))
    return f"{ratio:.2f} × repeatability"
