"""Wrong input as a new user would give it: one sentence that names place and remedy, exit code 2, nothing moved."""

from __future__ import annotations

import json
import re
from collections.abc import Callable
from pathlib import Path
from typing import Any

import pytest

from config import load_installation
from driver.recording import RunWriter
from service.cli.entry import run
from service.sessions.store import SessionStore

CSV = "t,q_joint1,q_joint2,q_joint3,tau_joint1,tau_joint2,tau_joint3\n0.0,1,2,3,1,1,1\n0.1,1,2,3,1,1,1\n"


def sentence(capsys: pytest.CaptureFixture[str], code: int, *arguments: str) -> str:
    """The one sentence on standard error of a command that must end with ``code`` and answer nothing."""
    assert run(arguments) == code
    shown = capsys.readouterr()
    assert shown.out == ""
    lines = [line for line in shown.err.strip().splitlines() if line.startswith("etude: ")]
    assert len(lines) == 1, shown.err
    assert "Traceback" not in shown.err
    return lines[0]


def replaced(old: str, new: str) -> Callable[[str], str]:
    def change(text: str) -> str:
        assert old in text
        return text.replace(old, new, 1)

    return change


def test_an_arm_that_is_none(
    capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch, tmp_path: Path
) -> None:
    """Nothing recorded is an answer for an arm that is known, or has recorded something; not for a slip of the hand."""
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path))
    assert run(["recordings", "--arm", "dda"]) == 0
    (tmp_path / "own" / "sessions").mkdir(parents=True)
    assert run(["recordings", "--arm", "own"]) == 0
    capsys.readouterr()
    for command in (["recordings"], ["report", "last"]):
        assert "dda" in sentence(capsys, 2, *command, "--arm", "dad")


@pytest.mark.parametrize(
    ("change", "said"),
    [
        (replaced("rate_hz", "rate_hx"), r"rate_hx.*rate_hz"),
        (replaced("[cycle]", "[cycle"), r"line \d+"),
        (replaced("rate_hz = 1000", "rate_hz = 1"), r"cycle\.rate_hz"),
        (replaced('name = "joint2"', 'name = "joint1"'), r"joint\[1\]\.name.*rename one"),
        (replaced("position_rad = [0.0, 5.5]", "position_rad = [5.5, 0.0]"), r"joint.*position_rad"),
        (replaced("rate_hz = 1000", "rate_hz = 4000"), r"µs of 250 µs"),
        (replaced("node_id = 1", 'node_id = "one"'), r"node_id"),
    ],
    ids=["typo", "syntax", "below-minimum", "joint-twice", "limits-swapped", "bus-too-slow", "wrong-type"],
)
def test_a_wrong_installation(
    change: Callable[[str], str], said: str, house: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    config = house.arm_files()
    config.write_text(change(config.read_text()))
    for command in (["check", "--arm"], ["up", "--virtual", "--arm"], ["daemon", "--config"], ["virtual", "--config"]):
        told = sentence(capsys, 2, *command, str(config))
        assert re.search(said, told), told
        assert "installation.toml" in told


def test_an_unknown_arm_is_answered_with_the_known_ones(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert "dda" in sentence(capsys, 2, "up", "--virtual", "--arm", "dad")


def test_an_eds_of_another_drive(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    config = house.arm_files()
    drives = Path(__file__).parents[2] / "config" / "drives"
    drive, eds = ((drives / name).read_text() for name in ("etude402_tacho.toml", "etude402.eds"))
    other, changes = re.subn(r"(\[1018sub2\][^\[]*DefaultValue=)\S+", r"\g<1>0x7777", eds)
    assert changes == 1
    (config.parent / "etude402_tacho.toml").write_text(drive.replace("etude402.eds", "other.eds"))
    (config.parent / "other.eds").write_text(other)
    told = sentence(capsys, 2, "check", "--arm", str(config))
    assert "product_code" in told
    assert "EDS of this drive" in told


@pytest.mark.parametrize(
    ("text", "said"),
    [
        (CSV.replace(",tau_joint2", ",tau_joint9"), "joint"),
        (CSV.replace("0.1,1,", "0.1,nan,"), "line 3"),
        (CSV.replace("0.1,", "-0.1,"), "line 3"),
        (CSV.replace("t,q_", "time,q_"), "t"),
        ("", "empty|header"),
    ],
    ids=["missing-column", "nan", "time-falls", "no-time", "empty"],
)
def test_a_wrong_csv(text: str, said: str, house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    path = house.folder / "foreign.csv"
    path.write_text(text)
    told = sentence(capsys, 2, "identify", "links", str(path), "--arm", "dda")
    assert re.search(said, told), told
    assert "foreign.csv" in told


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["identify", "links", "nowhere.mcap", "--arm", "dda"], "nowhere.mcap"),
        (["identify", "links", "a.csv", "--motion", "dda-practice"], "--motion"),
        (["identify", "links", "--hold-out", "a.csv"], "--hold-out"),
        (["identify", "links", "a.csv", "--hold", "torso"], "JOINT=VALUE"),
        (["identify", "links", "a.csv", "--hold", "torso=up"], "JOINT=VALUE"),
        (["identify", "links", "a.csv", "--hold", "torso=nan"], "JOINT=VALUE"),
        (["virtual", "--config", "dda", "--seed", "-1"], "--seed"),
        (["identify", "links", "a.csv", "--estimator", "magic"], "magic"),
        (["identify", "links", "a.csv", "--arm", "nothing.urdf"], "nothing.urdf"),
        (["up", "--lockstep"], "--virtual"),
        (["fly"], "fly"),
        (["run"], "MOTION"),
        (["status", "--jsn"], "--jsn"),
        (["report", "last"], "session"),
        (["recover", "nowhere.mcap"], "nowhere.mcap"),
        (["replay", "nowhere.mcap"], "nowhere.mcap"),
        (["export", "nowhere.mcap", "out.csv"], "nowhere.mcap"),
    ],
)
def test_wrong_usage(arguments: list[str], said: str, house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    assert said in sentence(capsys, 2, *arguments)


@pytest.mark.parametrize("arguments", [["status"], ["stop"], ["reset"], ["run", "dda-practice"], ["identify", "links"]])
def test_without_a_daemon(arguments: list[str], house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    told = sentence(capsys, 4, *arguments, "--arm", "dda")
    assert "etude up" in told


def test_without_the_stand_in_the_daemon_says_which_bus_is_missing(
    house: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    done = house.etude("daemon", "--config", "dda")
    assert done.returncode == 2
    told = [line for line in done.stderr.splitlines() if line.startswith("etude: ")]
    assert len(told) == 1
    assert "local:dda-can0" in told[0]
    assert "etude virtual" in told[0]


def test_an_interface_that_is_not_there(house: Any) -> None:
    config = house.arm_files()
    config.write_text(config.read_text().replace("local:dda-can0", "socketcan:can77"))
    done = house.etude("daemon", "--config", str(config))
    assert done.returncode == 2
    assert "can77" in done.stderr


@pytest.mark.parametrize(
    ("target", "said"),
    [
        ("/nowhere/answer.json", "there is no directory /nowhere"),
        (".", "is a directory"),
        ("/dev/null", "is no regular file"),
    ],
)
def test_an_answer_that_cannot_be_written_is_refused_before_anything_is_done(
    target: str, said: str, house: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    told = sentence(capsys, 2, "run", "dda-practice", "--arm", "dda", "--json", target)
    assert f"--json {target}" in told
    assert said in told, "and not that no daemon was there to ask"


def test_a_recording_is_held_against_the_arm_that_was_named(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    whole, cut = house.folder / "whole.mcap", house.folder / "cut.mcap"
    writer = RunWriter(whole, load_installation("dda"), {"mode": "csp"})
    writer.note("begun")
    writer.finish()
    cut.write_bytes(whole.read_bytes()[:-40])
    before = cut.read_bytes()
    for arguments in (["recover", str(cut)], ["replay", str(whole)], ["export", str(whole), str(cut) + ".csv"]):
        told = sentence(capsys, 2, *arguments, "--arm", "puma600")
        assert "is of arm dda, not of puma600; name that arm: --arm dda" in told
    assert cut.read_bytes() == before
    assert run(["recover", str(cut), "--arm", str(house.arm_files())]) == 0
    assert run(["replay", str(cut), "--arm", "dda"]) == 0


def test_what_serves_is_held_against_the_arm_that_was_named(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    config = str(house.arm_files())
    for command in ("daemon", "virtual"):
        told = sentence(capsys, 2, command, "--config", config, "--arm", "puma600")
        assert told == f"etude: --config {config}: is of arm dda, not of puma600; name that arm: --arm dda"


def test_the_demo_is_of_one_arm(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    out = house.folder / "demo"
    for other in ("puma600", str(house.arm_files("seven"))):
        told = sentence(capsys, 2, "demo", "--out", str(out), "--arm", other)
        assert "thesis' tables" in told
        assert f"etude up --virtual --arm {other}, then etude identify links" in told
    assert not out.exists()


def test_sessions_are_found_by_the_arms_installation_file(house: Any, capsys: pytest.CaptureFixture[str]) -> None:
    made = SessionStore(house.folder / "state", "dda").create("run", {}, attached=False, uid=0)
    assert run(["report", "last", "--arm", str(house.arm_files()), "--json", "-"]) == 0
    assert json.loads(capsys.readouterr().out)["id"] == made.id


def test_up_that_cannot_begin_says_so_once(house: Any, start: Any) -> None:
    start("virtual")
    done = house.etude("up", "--virtual", "--arm", "dda", "--lockstep")
    assert done.returncode == 2
    (told,) = (line for line in done.stderr.splitlines() if line.startswith("etude: "))
    assert "another stand-in arm runs on this bus" in told
