"""The model file: what is written is read back, with what it was learnt from; anything else is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config import InputError
from config.loader import HERE
from driver.recording import read_recording
from estimator import inverse_dynamics, load_rigid_body
from service.identification.links import identify
from service.identification.model_file import read_link_model
from service.identification.request import LinksRequest

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
    model = read_link_model(outcome.model)
    assert model.arm == "dda"
    assert model.joints == JOINTS
    by_name = {p.name: p for p in model.base_parameter}
    for row in outcome.answer["base_parameters"]:
        assert by_name[row["name"]].value == row["value"]
        assert by_name[row["name"]].standard_error == row["standard_error"]
    friction = {t.joint: t.value for t in model.joint_term if t.effect == "viscous_friction"}
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


def test_an_arm_must_be_named_where_the_recording_does_not(recorded: Path, tmp_path: Path) -> None:
    with pytest.raises(InputError, match="--arm"):
        identify(LinksRequest((recorded,), tmp_path))


@pytest.mark.parametrize(
    ("text", "said"),
    [("not = = toml", "not valid TOML"), ('kind = "links"', "format"), ("", "format"), ("format = 2", "format")],
)
def test_what_is_no_model_is_refused(text: str, said: str, tmp_path: Path) -> None:
    path = tmp_path / "links.toml"
    path.write_text(text)
    with pytest.raises(InputError, match=said):
        read_link_model(path)
