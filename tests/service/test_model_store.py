"""Models by name and version, shown and compared on the command line."""

from __future__ import annotations

import json
from pathlib import Path

import pytest

from config import InputError
from config.loader import HERE
from estimator import load_rigid_body
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from service import outcomes
from service.cli.entry import run
from service.models.model_file import ModelFile, model_file
from service.models.store import keep_model, model_path, named_model, next_version

URDF = HERE / "arms" / "dda" / "dda.urdf"


def friction(level: float, error: float = 0.1) -> FittedEffect:
    return FittedEffect("coulomb_friction", Place(1), {"level": level}, {"level": error})


@pytest.fixture
def kept(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> list[ModelFile]:
    """Two versions: friction, then more of it and a payload-free lighter first link."""
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path))
    body = load_rigid_body(URDF)
    first = model_file("dda", ArmModel(body, (friction(2.0),)), "named", [], version=next_version("dda"))
    keep_model(first)
    parameters = body.prior()
    parameters[9] *= 1.1
    offset = FittedEffect("torque_offset", Place(2), {"offset": 0.5})
    model = ArmModel(body.with_parameters(parameters), (friction(3.0), offset))
    second = model_file("dda", model, "named", [], version=next_version("dda"), parent=first.address)
    keep_model(second)
    return [first, second]


def test_names_mean_the_newest_or_a_version(kept: list[ModelFile]) -> None:
    assert named_model("dda") == named_model("dda@2") == kept[1]
    assert named_model("dda@1") == named_model(str(model_path("dda@1"))) == kept[0]
    assert next_version("dda") == 3
    with pytest.raises(InputError, match="no such version"):
        named_model("dda@7")
    with pytest.raises(InputError, match="there are models of dda"):
        named_model("scara")


def test_a_version_is_never_written_twice(kept: list[ModelFile]) -> None:
    before = model_path("dda@2").read_bytes()
    with pytest.raises(InputError, match="already there"):
        keep_model(kept[1])
    assert model_path("dda@2").read_bytes() == before


def test_show_tells_the_effects(kept: list[ModelFile], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["model", "show", "dda@1"]) == outcomes.DONE
    shown = capsys.readouterr().out
    assert "coulomb_friction" in shown
    assert "level 2 ± 0.1 N·m" in shown
    assert run(["model", "show", "dda", "--json", "-"]) == outcomes.DONE
    answer = json.loads(capsys.readouterr().out)
    assert [entry["name"] for entry in answer["effect"]] == ["coulomb_friction", "torque_offset"]
    assert answer["parent"] == kept[0].address


def test_show_tells_where_an_effect_is_and_refuses_what_no_arm_has(
    kept: list[ModelFile], capsys: pytest.CaptureFixture[str], tmp_path: Path
) -> None:
    late = FittedEffect("transport_delay", Place(1, channel="position"), {"delay": 0.004})
    path = keep_model(model_file("dda", ArmModel(load_rigid_body(URDF), (late,)), "named", [], version=3))
    assert run(["model", "show", str(path)]) == outcomes.DONE
    assert "joint2, position" in capsys.readouterr().out
    (other := tmp_path / "other.toml").write_text(path.read_text().replace('"position"', '"colour"'))
    assert run(["model", "show", str(other)]) == outcomes.BAD_INPUT
    assert "is none of joint2, colour" in " ".join(capsys.readouterr().err.split())


def test_diff_tells_what_changed(kept: list[ModelFile], capsys: pytest.CaptureFixture[str]) -> None:
    assert run(["model", "diff", "dda@1", "dda@2", "--json", "-"]) == outcomes.DONE
    answer = json.loads(capsys.readouterr().out)
    assert answer["extends"] is True
    assert [entry["name"] for entry in answer["effects"]["added"]] == ["torque_offset"]
    assert answer["effects"]["removed"] == []
    (changed,) = answer["effects"]["changed"]
    assert changed["parameter"] == "level"
    assert changed["standard_errors"] == pytest.approx(1.0 / (0.1 * 2**0.5))
    (inertia,) = answer["base_parameters"]
    assert inertia["after"] - inertia["before"] == pytest.approx(0.1 * 0.7418)
    assert run(["model", "diff", "dda@1", "dda@2"]) == outcomes.DONE
    assert "level 2 ± 0.1 N·m → 3 ± 0.1 N·m" in capsys.readouterr().out
    assert run(["model", "diff", "dda@2", "dda@2"]) == outcomes.DONE
    assert "no difference" in capsys.readouterr().out
    assert run(["model", "show", "scara"]) == outcomes.BAD_INPUT


def test_models_are_held_against_the_arm_that_was_named(
    kept: list[ModelFile], capsys: pytest.CaptureFixture[str]
) -> None:
    other = model_file("own", ArmModel(load_rigid_body(URDF), (friction(2.0),)), "named", [], version=1)
    keep_model(other)
    assert run(["model", "show", "dda", "--arm", "dda"]) == outcomes.DONE
    assert run(["model", "diff", "dda@1", "dda@2", "--arm", "dda"]) == outcomes.DONE
    capsys.readouterr()
    for arguments, said in (
        (["show", "dda@1", "--arm", "own"], "dda@1: is of arm dda, not of own; name that arm: --arm dda"),
        (["diff", "dda", "own", "--arm", "dda"], "own: is of arm own, not of dda; name that arm: --arm own"),
    ):
        assert run(["model", *arguments]) == outcomes.BAD_INPUT
        shown = capsys.readouterr()
        assert (shown.out, shown.err) == ("", f"etude: {said}\n")
