"""A model as MJCF, URDF and TOML: others' readers get what the model says, and are told what is missing."""

from __future__ import annotations

import json
from pathlib import Path

import mujoco
import numpy as np
import pytest

from config.loader import HERE
from estimator import load_rigid_body
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from service import outcomes
from service.cli.entry import run
from service.models.model_file import model_file, read_model, write_model

URDF = HERE / "arms" / "puma600" / "puma600.urdf"
SMOOTH = [
    FittedEffect("viscous_friction", Place(0), {"coefficient": 2.0}),
    FittedEffect("rotor_inertia", Place(1), {"inertia": 1.5}),
    FittedEffect("joint_spring", Place(2), {"stiffness": 20.0, "centre": 0.4}),
    FittedEffect("payload", Place(), {"mass": 1.0, "centre": np.array([0.0, 0.0, 0.1])}),
    FittedEffect("base_tilt", Place(), {"roll": 1e-3, "pitch": -2e-3}),
]
BEYOND = [
    FittedEffect("stribeck_friction", Place(3), {"level": 1.0, "breakaway": 2.0, "velocity": 0.1, "coefficient": 0.5}),
    FittedEffect("cogging", Place(4), {"order": 7.0, "amplitude": 0.1, "phase": 0.0}),
    FittedEffect("viscous_friction", Place(5), {"coefficient": 0.2, "bend": 0.5, "sharpness": 2.0}),
]


@pytest.fixture
def path(tmp_path: Path) -> Path:
    write_model(tmp_path / "arm.toml", model_file("puma", ArmModel(load_rigid_body(URDF), (*SMOOTH, *BEYOND)), "", []))
    return tmp_path / "arm.toml"


def exported(path: Path, name: str, capsys: pytest.CaptureFixture[str]) -> tuple[Path, list[str]]:
    output = path.parent / name
    assert run(["export", str(path), str(output), "--json", "-"]) == outcomes.DONE
    return output, json.loads(capsys.readouterr().out)["not_written"]


def test_mujoco_needs_the_model_s_torque(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output, missing = exported(path, "arm.xml", capsys)
    assert missing == [
        "stribeck_friction of joint4 (only in part)",
        "cogging of joint5 (no element in MJCF)",
        "viscous_friction of joint6 (no element in MJCF)",
    ]
    model = mujoco.MjModel.from_xml_path(str(output))
    data = mujoco.MjData(model)
    random = np.random.default_rng(0)
    q, dq, ddq = random.uniform(-1.0, 1.0, (3, 1, 6))
    data.qpos[:], data.qvel[:], data.qacc[:] = q[0], dq[0], ddq[0]
    mujoco.mj_inverse(model, data)
    expected = ArmModel(load_rigid_body(URDF), tuple(SMOOTH)).torque(q, dq, ddq, np.zeros(1))[0]
    # The payload's columns leave out its inertia about the flange, which the exported body has.
    np.testing.assert_allclose(data.qfrc_inverse[:3], expected[:3], rtol=1e-2, atol=0.05)
    stribeck = model.joint("joint4")
    assert (float(stribeck.frictionloss[0]), float(stribeck.damping[0])) == (1.0, 0.5)


def test_a_urdf_has_bodies_and_friction(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output, missing = exported(path, "arm.urdf", capsys)
    assert [sentence.split(" (")[0] for sentence in missing] == [
        "rotor_inertia of joint2",
        "joint_spring of joint3",
        "base_tilt of the arm",
        "stribeck_friction of joint4",
        "cogging of joint5",
        "viscous_friction of joint6",
    ]
    assert '<dynamics damping="2.0" friction="0.0" />' in output.read_text()
    given, loaded = load_rigid_body(URDF).prior(), load_rigid_body(output).prior()
    assert loaded[50] - given[50] == pytest.approx(1.0)
    np.testing.assert_allclose(loaded[:50], given[:50], atol=1e-9)


def test_toml_holds_everything(path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    output, missing = exported(path, "copy.toml", capsys)
    assert missing == []
    assert read_model(output) == read_model(path)
