"""The answer of `diagnose` as JSON."""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import numpy as np

from estimator.diagnosis.telling.answer import Diagnosis, Finding, Quantity, Residual
from estimator.effects import Place
from service.diagnosis.sentences import sentence_of, summary


def as_json(diagnosis: Diagnosis, notes: Sequence[str]) -> dict[str, Any]:
    """Plain data: SI units, joints by name."""
    joints = diagnosis.joints
    return {
        "verdict": diagnosis.verdict,
        "summary": summary(diagnosis),
        "findings": [_finding(finding, diagnosis) for finding in diagnosis.findings],
        "unexplained": {
            joints[joint]: {"share": left.share, "signature": left.signature}
            for joint, left in diagnosis.unexplained.items()
        },
        "torque_residual": {joint: _residual(r) for joint, r in zip(joints, diagnosis.torque_residual, strict=True)},
        "drive_residual": {joints[joint]: _residual(r) for joint, r in diagnosis.drive_residual.items()},
        "gear_residual": {joints[joint]: _residual(r) for joint, r in diagnosis.gear_residual.items()},
        "gain": {
            "held_out_torque": {
                "before_rms": diagnosis.held_out.before,
                "after_rms": diagnosis.held_out.after,
                "share_of_explainable": diagnosis.held_out.share_of_explainable,
                "unit": _common([r.unit for r in diagnosis.torque_residual]),
            },
            "simulation": None,
            "tracking": None,
        },
        "smallest_detectable": {
            effect: {"arm" if joint is None else joints[joint]: size for joint, size in sizes.items()}
            for effect, sizes in diagnosis.smallest_detectable.items()
        },
        "smallest_detectable_units": diagnosis.detectable_units,
        "model": None,
        "band_hz": diagnosis.band,
        "notes": [*notes, *diagnosis.notes],
    }


def _residual(residual: Residual) -> dict[str, Any]:
    return {
        "before_rms": residual.before,
        "after_rms": residual.after,
        "noise_rms": residual.noise,
        "unit": residual.unit,
    }


def experiment(
    sentence: str,
    motion: str | None = None,
    joints: Sequence[str] = (),
    playings: int | None = None,
    predicted_gap: float | None = None,
    drives_off_s: float | None = None,
) -> dict[str, Any]:
    """What would decide: in words; as the motion file where one was designed, and how often to play it, or for how many
    seconds to read the torques with the drives off; and the gap that it then promises, nats."""
    return {
        "motion": motion,
        "drives_off_s": drives_off_s,
        "joints": list(joints),
        "sentence": sentence,
        "playings": playings,
        "predicted_gap": predicted_gap,
    }


def _finding(finding: Finding, diagnosis: Diagnosis) -> dict[str, Any]:
    joints, place = diagnosis.joints, finding.place
    parameters = {name: _quantity(quantity) for name, quantity in finding.parameters.items()}
    if place.other is not None:
        parameters["joint_other"] = {"value": joints[place.other], "standard_error": None, "unit": ""}
    return {
        "effect": finding.effect,
        "joint": _joint(place, joints),
        "channel": place.channel,
        "status": finding.status,
        "sentence": sentence_of(finding, joints),
        "parameters": parameters,
        "share_of_explainable": finding.share_of_explainable,
        "evidence": {
            "log_likelihood_gain": finding.log_likelihood_gain,
            "false_alarm_probability": finding.false_alarm_probability,
        },
        "alternatives": [
            {
                "effect": a.effect,
                "joint": _joint(a.place, joints),
                "channel": a.place.channel,
                "log_likelihood_gap": a.log_likelihood_gap,
            }
            for a in finding.alternatives
        ],
        "next_experiment": None if finding.next_experiment is None else experiment(finding.next_experiment),
    }


def _common(units: Sequence[str]) -> str:
    """Of a mean over joints; ``N·m, N`` where they turn and slide."""
    return ", ".join(dict.fromkeys(units))


def _joint(place: Place, joints: Sequence[str]) -> str | None:
    return None if place.joint is None else joints[place.joint]


def _quantity(quantity: Quantity) -> dict[str, Any]:
    def plain(x: Any) -> Any:
        return x.tolist() if isinstance(x, np.ndarray) else float(x)

    return {"value": plain(quantity.value), "standard_error": plain(quantity.standard_error), "unit": quantity.unit}
