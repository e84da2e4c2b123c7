"""`etude certify` tells of a joint that its friction holds off its start, and of no other."""

from __future__ import annotations

import json
from pathlib import Path
from typing import Any

import pytest

from config import load_installation
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects.effect import Place
from service import outcomes
from service.cli.entry import run
from service.identification.arm_source import of_installation
from service.models.model_file import model_file, write_model

ROTORS = (0.62, 0.62, 0.48, 0.48, 0.17, 0.17, 0.15)
"""kg·m²: without them the certificate refuses the seven-joint arm."""
LEVELS = (1.6, 1.9, 1.3, 1.5, 0.7, 0.5, 0.5)
"""N·m of dry friction."""


def certified(levels: tuple[float, ...], folder: Path, capsys: pytest.CaptureFixture[str]) -> tuple[Any, str]:
    """Answer and report of `etude certify` for the seven-joint arm with that friction."""
    arm = load_installation("seven")
    effects = [FittedEffect("rotor_inertia", Place(i), {"inertia": x}) for i, x in enumerate(ROTORS)]
    effects += [FittedEffect("coulomb_friction", Place(i), {"level": x}) for i, x in enumerate(levels) if x > 0.0]
    body = of_installation(arm).rigid_body(arm.joint_names, {})
    model, target = folder / "model.toml", folder / "answer.json"
    write_model(model, model_file("seven", ArmModel(body, tuple(effects)), "made for a test", ()))
    asked = ["certify", "seven-practice", "--arm", "seven", "--model", str(model), "--json", str(target)]
    assert run(asked) == outcomes.DONE
    return json.loads(target.read_text()), capsys.readouterr().out


def test_the_joint_that_friction_holds_far_from_its_start_is_told(
    house: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer, report = certified(LEVELS, tmp_path, capsys)
    (sentence,) = answer["held_joints"]
    assert sentence.startswith("joint7 may stay above repeatability: by the model dry friction of 0.5 N·m")
    assert " ".join(sentence.split()) in " ".join(report.split())
    weakest = answer["sticking"]["joint7"]
    assert weakest["stick_band"] == pytest.approx(0.5 / 120.0)
    assert weakest["velocity_error_rms"] == pytest.approx(0.5 / (2.0 * 120.0 * 4.5 * 1.252) ** 0.5, rel=2e-3)
    assert 0.02 < weakest["held"] < 0.1


def test_nothing_is_said_where_friction_is_little_or_none(
    house: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    answer, report = certified((*LEVELS[:4], 0.0, 0.0, 0.05), tmp_path, capsys)
    assert answer["held_joints"] == []
    assert "may stay above repeatability" not in report
    assert answer["sticking"]["joint6"] == {
        "dry_friction": 0.0,
        "stick_band": 0.0,
        "held": 0.0,
        "velocity_error_rms": 0.0,
    }
    assert answer["sticking"]["joint1"]["stick_band"] == pytest.approx(1.6 / 3200.0)
