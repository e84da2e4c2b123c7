"""A block on the direct drive arm's wrist: identified by a session over bus and serial line, then from its files."""

from __future__ import annotations

import csv
import json
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from service.cli.entry import run
from service.supervision import SupervisedProcess

pytestmark = pytest.mark.timeout(600)

MASS, CENTRE = 1.106, np.array([0.001, 0.0, 0.047])
READY_S = 90.0
SWING = """
kind = "polynomial"
way_points_deg = [[280, 269.1, -30], [80, 19.1, 220], [180, 150, 60]]
duration_s = [1.0, 1.0]
dwell_s = 0.9
"""
SLOSH = """
extends = "dda"

[sloshing_load]
mass_kg = 1.106
centre_m = [0.001, 0.0, 0.047]
frequency_hz = 6.0
damping = 0.05
"""


WEAK_MOTOR = """
extends = "{of}"

[[motor]]
joint = "joint1"
gain = 0.94
"""


HEAD = 'format = 1\nkind = "loads"\n'


@dataclass(frozen=True)
class Ended:
    code: int
    out: str
    err: str


class Etude:
    """Commands that need no daemon, in the test's own process."""

    def __init__(self, capsys: pytest.CaptureFixture[str]) -> None:
        self._capsys = capsys

    def __call__(self, *arguments: str) -> Ended:
        self._capsys.readouterr()
        code = run(arguments)
        return Ended(code, *self._capsys.readouterr())

    def answer(self, *arguments: str) -> dict[str, Any]:
        done = self(*arguments, "--json", "-")
        assert done.code == 0, done.err
        answer: dict[str, Any] = json.loads(done.out)
        return answer


@pytest.fixture
def etude(capsys: pytest.CaptureFixture[str], house: Any) -> Etude:
    return Etude(capsys)


@dataclass(frozen=True)
class Identified:
    house: Any
    answer: dict[str, Any]
    recordings: list[str]


@pytest.fixture(scope="module")
def swing(tmp_path_factory: pytest.TempPathFactory) -> str:
    path = tmp_path_factory.mktemp("motions") / "swing.toml"
    path.write_text(SWING)
    return str(path)


def with_load(house: Any, hidden: str, *command: str) -> dict[str, Any]:
    """The answer of a command on the direct drive arm with these hidden mechanics."""
    running = []
    try:
        for process in (["virtual", "--hidden", hidden], ["daemon"]):
            running.append(SupervisedProcess([*process, "--config", "dda", "--lockstep"], house.environment))
            running[-1].wait_ready(READY_S)
        answer: dict[str, Any] = house.answer(*command)
        return answer
    finally:
        for process in reversed(running):
            process.stop()


@pytest.fixture(scope="module")
def identified(swing: str, new_house: Any) -> Iterator[Identified]:
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        house = new_house(Path(folder))
        answer = with_load(house, "dda-block", "identify", "load", "--motion", swing)
        yield Identified(house, answer, answer["recordings"])


def test_a_session_identifies_the_block(identified: Identified) -> None:
    answer = identified.answer
    assert answer["status"] == "identified"
    assert abs(answer["mass"]["value"] - MASS) < 0.040
    assert np.abs(np.array(answer["centre"]["value"]) - CENTRE).max() < 0.002
    np.testing.assert_allclose(answer["inertia"]["value"], [0.0023785, 0, 0, 0.0004757, 0, 0.0023785], atol=3e-4)
    assert answer["wrench_delay"]["value"] == pytest.approx(0.0033, abs=0.001)
    np.testing.assert_allclose(answer["offset"]["value"], [2.4, -1.1, 3.6, 0.05, -0.08, 0.03], atol=0.2)
    names = [Path(path).stem for path in identified.recordings]
    assert names == ["rest-before", "swing", "rest-after"]
    report = identified.house.answer("report", answer["session"])
    assert report["result"]["mass"] == answer["mass"]
    assert Path(answer["plot"]).stat().st_size > 10_000


def test_the_load_was_known_while_the_arm_moved(identified: Identified) -> None:
    live = identified.answer["live"]["mass"]
    assert live["unit"] == "kg"
    assert 0.0 < live["standard_error"] < 0.1
    assert abs(live["value"] - MASS) < 4.0 * live["standard_error"]


def test_recordings_alone_say_the_same_in_every_form(identified: Identified, tmp_path: Path, etude: Etude) -> None:
    files = identified.recordings
    again = etude.answer("identify", "load", *files, "--out", str(tmp_path / "again"))
    assert again["mass"] == identified.answer["mass"]
    integrated = etude.answer("identify", "load", *files, "--form", "integrated", "--out", str(tmp_path / "i"))
    assert integrated["mass"]["value"] == pytest.approx(again["mass"]["value"], abs=0.005)
    foreign = tmp_path / "foreign.csv"
    etude.answer("export", files[1], str(foreign))
    held = etude.answer(
        "identify", "load", str(foreign), "--hold-out", files[1], "--arm", "dda", "--out", str(tmp_path / "csv")
    )
    assert abs(held["mass"]["value"] - MASS) < 0.040
    assert held["hold_out"]["swing.mcap"]["fz"]["relative"] < 0.1


def test_the_load_is_recognised_verified_or_refused(identified: Identified, tmp_path: Path, etude: Etude) -> None:
    files = identified.recordings
    library = tmp_path / "loads.toml"
    library.write_text(
        'format = 1\nkind = "loads"\n'
        '[[load]]\nname = "block"\nmass = 1.106\ncentre = [0.001, 0.0, 0.047]\n'
        "inertia = [0.0023785, 0.0, 0.0, 0.0004757, 0.0, 0.0023785]\n"
        '[[load]]\nname = "jug"\nmass = 1.9\ncentre = [0.0, 0.0, 0.1]\ninertia = [0.01, 0, 0, 0.01, 0, 0.004]\n'
    )
    nominal = tmp_path / "nominal.toml"
    nominal.write_text(
        'format = 1\nkind = "loads"\n[[load]]\nname = "block"\nmass = 1.106\ncentre = [0.001, 0.0, 0.047]\n'
    )
    asked = ("identify", "load", *files, "--load-library", str(library), "--out", str(tmp_path / "out"))
    answer = etude.answer(*asked, "--expect", str(nominal), "--mass-tolerance", "0.04", "--centre-tolerance", "0.002")
    assert answer["verification"]["verdict"] == "accepted"
    assert set(answer["recognition"]["p_values"]) == {"block", "jug"}
    wrong = tmp_path / "wrong.toml"
    wrong.write_text('format = 1\nkind = "loads"\n[[load]]\nname = "jug"\nmass = 1.9\ncentre = [0.0, 0.0, 0.1]\n')
    refused = etude("identify", "load", *files, "--expect", str(wrong), "--out", str(tmp_path / "no"))
    assert refused.code == 1
    assert "rejected: jug" in refused.out
    known = Path(identified.answer["load_file"])
    hand = etude.answer("identify", "load", *files, "--hand", str(known), "--out", str(tmp_path / "hand"))
    assert abs(hand["mass"]["value"]) < 1e-6


def test_wrong_input_is_one_sentence(identified: Identified, tmp_path: Path, etude: Etude) -> None:
    files = identified.recordings
    table = tmp_path / "with.csv"
    etude.answer("export", files[1], str(table))
    bare = tmp_path / "bare.csv"
    with table.open() as source, bare.open("w", newline="") as target:
        rows = list(csv.reader(source))
        csv.writer(target).writerows(row[:-6] for row in rows)
    two = tmp_path / "two.csv"
    with two.open("w", newline="") as target:
        kept = [k for k, name in enumerate(rows[0]) if not name.endswith("joint3")]
        csv.writer(target).writerows([row[k] for k in kept] for row in rows)
    degrees = tmp_path / "degrees.csv"
    with degrees.open("w", newline="") as target:
        turned = [k for k, name in enumerate(rows[0]) if name.startswith("dq_")]
        scaled = [[str(float(x) * 57.29578) if k in turned else x for k, x in enumerate(row)] for row in rows[1:]]
        csv.writer(target).writerows([rows[0], *scaled])
    library = tmp_path / "loads.toml"
    library.write_text('format = 1\nkind = "loads"\n[[load]]\nname = "x"\nweight = 1.0\n')
    urdf = str(Path("config/arms/dda/dda.urdf").absolute())
    for arguments, said in (
        ((str(bare), "--arm", "dda"), "has no wrench"),
        ((str(degrees), "--arm", "dda", "--frame", "tool"), "degrees"),
        ((files[1], "--arm", "puma600"), "dda, not of puma600"),
        ((files[1], "--without", str(two), "--arm", "dda"), "lacks joint joint3"),
        ((files[1], "--without", files[1]), "both learnt from and without the load"),
        ((files[0],), "not told from the sensor's offset"),
        ((files[1], "--tare", files[1]), "does not rest|common"),
        ((files[1], "--load-library", str(library)), "weight|mass"),
        ((str(table), "--arm", urdf), "does not say where the load is held"),
        ((files[1], "--motion", "dda-load"), "moving the arm"),
        ((files[1], "--without", files[0], "--form", "static"), "no choice when joint torques tell"),
    ):
        refused = etude("identify", "load", *arguments, "--out", str(tmp_path / "out"))
        assert refused.code == 2, (arguments, refused.out, refused.err)
        sentences = [line for line in refused.err.splitlines() if line.startswith("etude: ")]
        assert len(sentences) == 1, refused.err
        assert any(part in sentences[0] for part in said.split("|")), sentences[0]


def test_a_torque_constant_needs_a_free_recording_of_its_own(identified: Identified, etude: Etude) -> None:
    played = identified.recordings[1]
    refused = etude("calibrate", "torque-constant", played, "--without", played)
    assert refused.code == 2
    assert "both loaded and without the load" in refused.err


def test_torque_constants_come_of_two_sessions(swing: str, new_house: Any, tmp_path: Path) -> None:
    """The first without the load, the second with it, on an arm whose first motor gives less than it says."""
    hidden = {of: tmp_path / f"weak-{of}.toml" for of in ("dda", "dda-block")}
    for of, path in hidden.items():
        path.write_text(WEAK_MOTOR.format(of=of))
    asked = ("calibrate", "torque-constant", "--motion", swing)
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        house = new_house(Path(folder))
        free = with_load(house, str(hidden["dda"]), *asked)
        assert free["status"] == "recorded without the load"
        without = [part for path in free["recordings"] for part in ("--without", path)]
        answer = with_load(house, str(hidden["dda-block"]), *asked, *without)
        kept = house.answer("report", answer["session"])
    assert answer["status"] == "calibrated"
    assert kept["result"]["joints"] == answer["joints"]
    for joint, gain in (("joint1", 0.94), ("joint2", 1.0)):
        found = answer["joints"][joint]["gain"]
        assert found["value"] == pytest.approx(gain, abs=0.02)
        assert 0.0 < found["standard_error"] < 0.01


def test_a_sloshing_load_is_no_rigid_body(swing: str, new_house: Any, tmp_path: Path) -> None:
    hidden = tmp_path / "slosh.toml"
    hidden.write_text(SLOSH)
    with tempfile.TemporaryDirectory(prefix="etude-t") as folder:
        answer = with_load(new_house(Path(folder)), str(hidden), "identify", "load", "--motion", swing)
    assert answer["status"] == "not rigid"
    assert answer["rigid"]["p_value"] < 1e-4
    assert answer["mass"]["standard_error"] is None
    assert any("no rigid body" in warning for warning in answer["warnings"])
