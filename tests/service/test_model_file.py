"""The model file: what is written is read back, with what it was learnt from; anything else is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config import InputError
from config.loader import HERE
from driver.recording import read_recording
from estimator import inverse_dynamics, load_rigid_body
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from service.identification.links import identify
from service.identification.request import LinksRequest
from service.models.model_file import ModelFile, arm_model, model_file, model_text, read_model, write_model

URDF = HERE / "arms" / "dda" / "dda.urdf"
JOINTS = ("joint1", "joint2", "joint3")


@pytest.fixture(scope="module")
def recorded(tmp_path_factory: pytest.TempPathFactory) -> Path:
    """Seven seconds of the direct drive arm with the URDF's own bodies, viscous friction and noise, as CSV."""
    path = tmp_path_factory.mktemp("recorded") / "motion.csv"
    random = np.random.default_rng(5)
    t = np.arange(0.0, 7.0, 0.004)
    w = 2 * np.pi * np.array([[0.31, 0.47, 0.61], [0.83, 0.71, 1.07]])
    a = np.array([[0.8, 0.7, 0.9], [0.25, 0.3, 0.35]])
    phase = t[:, None, None] * w
    q = np.sum(a * np.sin(phase), axis=1) + [3.5, 2.7, 1.7]
    dq = np.sum(a * w * np.cos(phase), axis=1)
    ddq = np.sum(-a * w**2 * np.sin(phase), axis=1)
    body = load_rigid_body(URDF)
    tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + [2.0, 1.0, 0.3] * dq
    tau += random.normal(0.0, 0.05, tau.shape)
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "dq", "tau") for joint in JOINTS)])
    np.savetxt(path, np.column_stack([t, q, dq, tau]), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


def test_a_model_is_read_back_with_its_sources(recorded: Path, tmp_path: Path) -> None:
    outcome = identify(LinksRequest((recorded,), tmp_path, arm=str(URDF)))
    model = read_model(outcome.model)
    assert model.arm == "dda"
    assert model.joints == JOINTS
    by_name = {p.name: p for p in model.base_parameter}
    for row in outcome.answer["base_parameters"]:
        assert by_name[row["name"]].value == row["value"]
        assert by_name[row["name"]].standard_error == row["standard_error"]
    friction = {e.joint: e.parameter["coefficient"].value for e in model.effect if e.name == "viscous_friction"}
    np.testing.assert_allclose([friction[j] for j in JOINTS], [2.0, 1.0, 0.3], rtol=0.05)
    source = model.learnt_from[0]
    assert (source.path, source.samples) == (str(recorded), len(read_recording(recorded).t))
    assert len(source.sha256) == 64


def test_the_written_urdf_moves_as_the_model(recorded: Path, tmp_path: Path) -> None:
    outcome = identify(LinksRequest((recorded,), tmp_path, arm=str(URDF)))
    assert outcome.urdf is not None
    body = load_rigid_body(outcome.urdf)
    base = outcome.result.base.combination @ body.prior()
    off = (base - outcome.result.beta) / outcome.result.standard_error[: outcome.result.base.rank]
    assert np.max(np.abs(off)) < 3.0
    assert outcome.plot.read_bytes().startswith(b"\x89PNG")


def test_a_recording_is_not_learnt_from_and_held_out_at_once(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="both learnt from and held out"):
        identify(LinksRequest((recorded,), tmp_path, hold_out=(recorded,), arm=str(URDF)))


def test_a_recording_counts_once(recorded: Path, tmp_path: Path) -> None:
    """Two playings of a motion differ by their noise; a copy would say that there is none."""
    copy = tmp_path / f"copy{recorded.suffix}"
    copy.write_bytes(recorded.read_bytes())
    for again in (recorded, copy):
        with pytest.raises(InputError, match="is the same recording as"):
            identify(LinksRequest((recorded, again), tmp_path, arm=str(URDF)))


def test_an_arm_must_be_named_where_the_recording_does_not(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--arm"):
        identify(LinksRequest((recorded,), tmp_path))


@pytest.mark.parametrize(
    ("text", "said"),
    [("not = = toml", "not valid TOML"), ('kind = "model"', "format"), ("", "format"), ("format = 3", "format")],
)
def test_what_is_no_model_is_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "links.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_model(path)


EXTENDED = [
    FittedEffect("stribeck_friction", Place(1), {"level": 1.0, "breakaway": 2.0, "velocity": 0.1, "coefficient": 0.5}),
    FittedEffect("coulomb_friction", Place(0), {"level": 3.0}, {"level": 0.1}, np.array([0.05])),
    FittedEffect("transmission_coupling", Place(1, other=2),
                 {"joint_other": 2.0, "ratio": -1.0, "coefficient": 0.2, "level": 0.1}, {}, np.array([0.02])),
    FittedEffect("payload", Place(), {"mass": 2.0, "centre": np.array([0.1, 0.0, 0.2])},
                 {"mass": 0.1, "centre": np.array([0.01, 0.01, 0.02])}),
    FittedEffect("transport_delay", Place(channel="torque"), {"delay": 0.004}),
    FittedEffect("transport_delay", Place(2, channel="position"), {"delay": 0.002}, {}, np.array([3.0])),
    FittedEffect("viscous_friction", Place(0), {"coefficient": 2.0, "bend": 0.6, "sharpness": 1.5}),
    FittedEffect("contact", Place(), {"where": np.array([0.1, 0.0, 0.0]), "force": np.array([-9.0, 0.0, 0.0])}),
]  # fmt: skip


@pytest.fixture
def extended() -> ModelFile:
    return model_file("dda", ArmModel(load_rigid_body(URDF), tuple(EXTENDED)), "made up", [], version=2)


def test_a_model_with_effects_predicts_the_same_after_a_round_trip(extended: ModelFile, tmp_path: Path) -> None:
    path = tmp_path / "model.toml"
    write_model(path, extended)
    read = read_model(path)
    assert read == extended
    assert read.address == extended.address
    assert "<robot" in path.read_text(), "the URDF is there to be read"
    t = np.linspace(0.0, 2.0, 400)
    q = 1.0 + 0.5 * np.sin(3.0 * t)[:, None] * [1.0, 0.8, 1.2]
    dq = np.gradient(q, t, axis=0)
    ddq = np.gradient(dq, t, axis=0)
    torque = ArmModel(load_rigid_body(URDF), tuple(EXTENDED)).torque(q, dq, ddq, t)
    np.testing.assert_allclose(arm_model(read).torque(q, dq, ddq, t), torque, rtol=1e-9, atol=1e-9)


@pytest.mark.parametrize(
    ("found", "put", "said"),
    [
        ('joint = "joint2"', 'joint = "elbow"', "no joint 'elbow'"),
        ('name = "payload"', 'name = "gremlins"', "not in the catalogue"),
        ("parameter.mass", "parameter.weight", "no 'weight'"),
        ("joint3 = [", "joint3 = [1.0, ", "ten numbers"),
        ("shape = [0.05]", "shape = [0.05, 1.0]", "shape of 2 numbers"),
        ("shape = [0.05]", "shape = [nan]", "the shape nan at .*zero or more"),
        ("shape = [0.05]", "shape = [-0.05]", "the shape -0.05 at .*zero or more"),
        ('channel = "torque"', 'channel = "temperature"', "none of temperature"),
        ('channel = "position"', 'channel = "velocity"', "none of joint3, velocity"),
        ("shape = [3.0]", "shape = [1.0]", "the shape 1 at joint3, position.*one of 0, 3"),
        ("parameter.breakaway", "parameter.level", "TOML"),
        ('parameter.velocity = { "value" = 0.1', 'parameter.velocity = { "value" = -0.1', "'velocity' is -0.1"),
        ('parameter.bend = { "value" = 0.6', 'parameter.bend = { "value" = 0.0', "'bend' is 0; give more than zero"),
        ('parameter.mass = { "value" = 2.0', 'parameter.mass = { "value" = nan', "'mass' is no finite number"),
        ('parameter.delay = { "value" = 0.004, "unit" = "s" }', "", "lacks 'delay'"),
        ('"value" = [0.1, 0.0, 0.2]', '"value" = [0.1, 0.2]', "not as many numbers"),
        ('"value" = [-9.0, 0.0, 0.0]', '"value" = [-9.0, 0.0]', "too few or too many numbers"),
        ('"value" = [0.1, 0.0, 0.0]', '"value" = [0.1, 0.0, 0.0, 0.0]', "too few or too many numbers"),
    ],
)
def test_what_the_arm_cannot_have_is_refused(
    found: str, put: str, said: str, extended: ModelFile, tmp_path: Path
) -> None:
    path = tmp_path / "model.toml"
    text = model_text(extended).replace('"joint3" =', "joint3 =")
    assert found in text
    path.write_text(text.replace(found, put))
    with pytest.raises(InputError, match=said):
        arm_model(read_model(path))


def test_units_are_those_of_what_is_told(extended: ModelFile) -> None:
    """A push has times and a force, a wall a place and a stiffness."""
    wall = {name: parameter.unit for name, parameter in extended.effect[-1].parameter.items()}
    assert wall == {"where": "m", "force": "N/m"}
    push = FittedEffect("contact", Place(), {"where": np.array([1.0, 2.0]), "force": np.array([1.0, 0.0, 0.0])})
    (told,) = model_file("dda", ArmModel(load_rigid_body(URDF), (push,)), "made up", []).effect
    assert {name: parameter.unit for name, parameter in told.parameter.items()} == {"where": "s", "force": "N"}


def test_a_sliding_joint_s_effects_have_units_of_forces(tmp_path: Path) -> None:
    urdf = tmp_path / "slide.urdf"
    urdf.write_text(
        "<robot name='slide'><link name='base'/><link name='carriage'><inertial><mass value='3'/>"
        "<inertia ixx='1' ixy='0' ixz='0' iyy='1' iyz='0' izz='1'/></inertial></link><joint name='axis' "
        "type='prismatic'><parent link='base'/><child link='carriage'/><axis xyz='1 0 0'/>"
        "<limit lower='-1' upper='1' velocity='1' effort='9'/></joint></robot>"
    )
    spring = FittedEffect("joint_spring", Place(0), {"stiffness": 60.0, "centre": 0.05}, {"stiffness": 0.1})
    file = model_file("slide", ArmModel(load_rigid_body(urdf), (spring,)), "made up", [])
    units = {name: parameter.unit for name, parameter in file.effect[0].parameter.items()}
    assert units == {"stiffness": "N/m", "centre": "m"}
