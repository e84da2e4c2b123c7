"""From a named cause to a better model: what a diagnosis finds is kept as a version, simulated, and predicts."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pytest

from config.loader import HERE
from estimator import inverse_dynamics, load_rigid_body
from service.diagnosis.diagnosing import DiagnosisOutcome, diagnose_recordings
from service.diagnosis.request import DiagnoseRequest
from service.models.model_file import arm_model, read_model
from service.models.store import model_path

URDF = HERE / "arms" / "dda" / "dda.urdf"
LEVEL = 3.0


def record(path: Path, seed: int) -> Path:
    """Eight seconds of the direct drive arm whose second joint rubs; another seed, another noise."""
    random = np.random.default_rng(seed)
    body = load_rigid_body(URDF)
    t = np.arange(0.0, 8.0, 0.004)
    w = 2 * np.pi * np.array([[0.31, 0.47, 0.61], [0.83, 0.71, 1.07]])
    a = np.array([[0.8, 0.7, 0.9], [0.25, 0.3, 0.35]])
    phase = t[:, None, None] * w
    q = np.sum(a * np.sin(phase), axis=1) + [3.5, 2.7, 1.7]
    dq, ddq = np.sum(a * w * np.cos(phase), axis=1), np.sum(-a * w**2 * np.sin(phase), axis=1)
    tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
    tau[:, 1] += LEVEL * np.sign(dq[:, 1])
    tau += random.normal(0.0, 0.3, tau.shape)
    q += random.normal(0.0, 2e-5, q.shape)
    header = ",".join(["t", *(f"{kind}_{joint}" for kind in ("q", "dq", "tau") for joint in body.joints)])
    np.savetxt(path, np.column_stack([t, q, dq, tau]), delimiter=",", header=header, comments="", fmt="%.9g")
    return path


@pytest.fixture(scope="module")
def outcome(tmp_path_factory: pytest.TempPathFactory) -> DiagnosisOutcome:
    directory = tmp_path_factory.mktemp("diagnosed")
    recordings = tuple(record(directory / f"{seed}.csv", seed) for seed in (1, 2))
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ETUDE_STATE", str(directory))
        outcome = diagnose_recordings(DiagnoseRequest(recordings, arm=str(URDF), directory=directory / "out"))
        assert outcome.answer["model_name"] == "dda@1"
        assert Path(outcome.answer["model"]).read_bytes() == model_path("dda@1").read_bytes()
    return outcome


def test_the_simulation_comes_nearer_to_the_recording(outcome: DiagnosisOutcome) -> None:
    simulation = outcome.answer["gain"]["simulation"]
    assert simulation["position_after_rms"] < 0.15 * simulation["position_before_rms"]
    assert simulation["joints"]["joint2"]["before_rms"] > 5.0 * simulation["joints"]["joint1"]["before_rms"]
    assert "1 Hz" in simulation["controller"]


def test_the_extended_model_is_kept_with_what_it_was_learnt_from(outcome: DiagnosisOutcome) -> None:
    file = read_model(Path(outcome.answer["model"]))
    assert [Path(source.path).name for source in file.learnt_from] == ["1.csv", "2.csv"]
    found = {(entry.name, entry.joint): entry.parameter for entry in file.effect}
    level = found["coulomb_friction", "joint2"]["level"]
    assert level.value == pytest.approx(LEVEL, abs=0.1)
    assert level.unit == "N·m"
    assert level.standard_error is not None


def test_the_extended_model_predicts_the_friction(outcome: DiagnosisOutcome) -> None:
    model = arm_model(read_model(Path(outcome.answer["model"])))
    speed = np.array([[0.0, 1.0, 0.0], [0.0, -1.0, 0.0]])
    still = np.zeros((2, 3))
    torque = model.at_rate(250.0).torque(still, speed, still)
    rigid = inverse_dynamics(model.body, model.body.prior(), still, speed, still)
    np.testing.assert_allclose(torque - rigid, [[0.0, LEVEL, 0.0], [0.0, -LEVEL, 0.0]], atol=0.1)
