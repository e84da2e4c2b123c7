"""`etude check` looks at everything and names remedies; it moves and starts nothing."""

from __future__ import annotations

import json
import re
from pathlib import Path
from typing import Any

import pytest

from config import load_installation
from service.checks import run_checks
from service.checks.description import check_description
from service.checks.floor import check_floor
from service.checks.realtime import preemption
from service.checks.sensors import check_sensors
from service.checks.servos import check_servos
from service.cli.entry import run


def test_without_an_arm_the_buses_fail_with_a_remedy(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["check", "--arm", "dda", "--json", "-"]) == 1
    answer = json.loads(capsys.readouterr().out)
    assert answer["verdict"] == "not sound"
    failed = {f["subject"] for f in answer["findings"] if f["verdict"] == "fail"}
    assert failed == {"can0", "can1", "can2", "wrist"}
    assert all(f["remedy"] for f in answer["findings"] if f["verdict"] != "ok")


def test_every_shipped_arm_is_described_soundly() -> None:
    for arm in ("dda", "puma600", "seven"):
        installation = load_installation(arm)
        findings = list(check_description(installation))
        assert {f.verdict for f in findings} <= {"ok", "warn"}, arm
        assert sum(f.subject.startswith("bus time") for f in findings) == len(installation.bus) * len(
            installation.modes
        )


def test_a_motion_of_the_arm_that_leaves_its_limits_is_found(house: Any) -> None:
    config = house.arm_files()
    slower, changes = re.subn(r"velocity_rad_s = [\d.]+", "velocity_rad_s = 2.0", config.read_text())
    assert changes == 3
    config.write_text(slower)
    findings = {f.subject: f for f in check_description(load_installation(str(config)))}
    assert findings["motion dda-identify-1"].verdict == "fail"
    assert "joint1" in findings["motion dda-identify-1"].detail


def test_real_time_ability_is_tried_and_measured(house: Any) -> None:
    findings = {f.subject: f for f in run_checks(load_installation("dda")) if f.area == "real time"}
    assert set(findings) == {"scheduling", "kernel preemption", "lateness"}
    assert "µs" in findings["lateness"].detail
    assert preemption() in ("rt", "full", "lazy", "voluntary", "none", "unknown")


def test_a_sensor_that_is_there_is_reported(house: Any, tmp_path: Path) -> None:
    config = house.arm_files()
    text = config.read_text()
    assert 'port = "pty:dda-wrist"' in text
    line = tmp_path / "line"
    config.write_text(text.replace('port = "pty:dda-wrist"', f'port = "{line}"'))
    missing = next(check_sensors(load_installation(str(config))))
    assert missing.verdict == "fail"
    line.touch()
    assert next(check_sensors(load_installation(str(config)))).verdict == "ok"


def test_gains_that_would_shake_the_arm_are_found_without_moving_it(house: Any) -> None:
    assert {f.verdict for f in check_servos(load_installation("dda"))} == {"ok"}
    config = house.arm_files()
    text = config.read_text()
    gains = "servo = { stiffness_nm_rad = 540, damping_nms_rad = 28.7 }"
    assert gains in text
    config.write_text(text.replace(gains, "servo = { stiffness_nm_rad = 54000, damping_nms_rad = 2870 }"))
    found = {f.subject: f for f in check_servos(load_installation(str(config)))}
    assert found["servo gains, csp"].verdict == "warn"
    assert "joint3 would swing at" in found["servo gains, csp"].detail
    assert found["digital gains, cst"].verdict == "ok"


def test_a_home_below_the_floor_is_found_as_a_design_finds_it(house: Any) -> None:
    assert list(check_floor(load_installation("puma600"))) == [], "no floor is configured"
    config = house.arm_files("puma600")
    text = config.read_text()
    assert text.count("\nhome_rad") == 1
    for floor, verdict, said in (
        (-0.2, "fail", "the arm's home is 0.0438 m below -0.2 m"),
        (-0.3, "ok", "above -0.3 m"),
    ):
        config.write_text(text.replace("\nhome_rad", f"\nfloor_m = {floor}\nhome_rad"))
        found = {f.subject: f for f in run_checks(load_installation(str(config)))}["arm.floor_m"]
        assert found.verdict == verdict
        assert said in found.detail
        assert (found.remedy != "") == (verdict == "fail")
