"""The units and rules: what they start exists, and they grant what the loop asks for."""

from __future__ import annotations

import re
import shutil
import subprocess
from pathlib import Path

import pytest

from config.loader import HERE

UNITS = sorted((HERE / "systemd").glob("*.service"))


def settings(path: Path) -> dict[str, list[str]]:
    found: dict[str, list[str]] = {}
    for line in path.read_text().splitlines():
        if line and not line.startswith(("#", "[")):
            key, value = line.split("=", 1)
            found.setdefault(key, []).append(value)
    return found


def test_the_daemon_is_watched_and_may_be_punctual() -> None:
    unit = settings(HERE / "systemd" / "etude@.service")
    assert unit["Type"] == ["notify"]
    assert float(unit["WatchdogSec"][0]) >= 2 * 2.0, "the daemon gives a sign of life at least every two seconds"
    assert int(unit["LimitRTPRIO"][0]) >= 98, "the highest priority a configuration may ask for"
    assert unit["LimitMEMLOCK"] == ["infinity"]
    assert "RestrictRealtime" not in unit and "MemoryDenyWriteExecute" not in unit
    assert unit["KillMode"] == ["control-group"], "the loop of a crashed daemon must get SIGTERM, not SIGKILL"
    assert {"AF_UNIX", "AF_CAN"} <= set(unit["RestrictAddressFamilies"][0].split())
    assert unit["Group"] == ["etude"] and unit["Restart"] == ["no"]


@pytest.mark.parametrize("unit", ["etude@.service", "etude-virtual@.service"])
def test_directories_outlive_either_service(unit: str) -> None:
    found = settings(HERE / "systemd" / unit)
    assert found["RuntimeDirectory"] == ["etude"] and found["RuntimeDirectoryPreserve"] == ["yes"]


def test_the_stand_in_may_not_touch_the_sensors_of_a_real_arm() -> None:
    assert settings(HERE / "systemd" / "etude-virtual@.service")["DeviceAllow"] == ["char-pts rw"]


MOST_EXPOSED = 1.9
"""Of 10; what is left has its reason in docs/safety.md."""


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda p: p.name)
def test_the_units_expose_little(unit: Path) -> None:
    done = subprocess.run(
        ["systemd-analyze", "security", "--offline=yes", "--no-pager", str(unit)],
        capture_output=True, text=True, timeout=60, check=False, env={"LC_ALL": "C.UTF-8", "PATH": "/usr/bin:/bin"},
    )  # fmt: skip
    found = re.search(r"Overall exposure level for .*: ([\d.]+)", done.stdout)
    if found is None:
        pytest.skip("this systemd-analyze cannot judge a unit that is not installed")
    assert float(found[1]) <= MOST_EXPOSED


@pytest.mark.skipif(shutil.which("systemd-analyze") is None, reason="systemd-analyze is not installed")
@pytest.mark.parametrize("unit", UNITS, ids=lambda p: p.name)
def test_systemd_understands_the_units(unit: Path, tmp_path: Path) -> None:
    """As an instance, with a program that exists in the place of the installed one."""
    instance = tmp_path / unit.name.replace("@", "@dda")
    instance.write_text(unit.read_text().replace("/opt/etude/.venv/bin/etude", "/bin/true"))
    done = subprocess.run(
        ["systemd-analyze", "verify", "--man=no", str(instance)],
        capture_output=True,
        text=True,
        timeout=60,
        check=False,
    )
    complaints = [line for line in done.stderr.splitlines() if instance.name in line]
    assert not complaints


def test_udev_rules_are_whole_lines_of_conditions_and_assignments() -> None:
    part = re.compile(r'[A-Z_]+(\{[A-Za-z_]+\})?(==|!=|\+=|=)"[^"]*"')
    rules = [r for r in (HERE / "udev" / "60-etude.rules").read_text().splitlines() if r and not r.startswith("#")]
    for rule in rules:
        assert all(part.fullmatch(piece) for piece in rule.split(", ")), rule
    assert any('ATTR{latency_timer}="1"' in rule for rule in rules)
    assert any("etude-can@$name.service" in rule for rule in rules)


def test_everything_is_package_data() -> None:
    import tomllib

    project = tomllib.loads((HERE.parent / "pyproject.toml").read_text())
    patterns = project["tool"]["setuptools"]["package-data"]["config"]
    packed = {p for pattern in patterns for p in HERE.glob(pattern)}
    wanted = {p for p in HERE.rglob("*") if p.is_file() and p.suffix not in (".py", ".pyc", ".typed")}
    assert not wanted - packed
