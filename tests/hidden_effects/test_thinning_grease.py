"""Grease that is thinner when it is warm, in a joint whose drive tells its temperature: every motion was played again
when the joint was warmer, so that the playings differ by far more than their noise."""

from __future__ import annotations

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.campaign.plans import Plan
from benchmarks.campaign.playing import as_recorded, play
from benchmarks.campaign.scenario import prepare
from benchmarks.campaign.sealing import HELD_OUT
from estimator import Trajectory, load_rigid_body
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.naming.restless import RESTLESS
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from virtual_hw.hidden.friction import Friction
from virtual_hw.hidden.motor import Thermal

Array = NDArray[np.float64]
JOINT = "joint2"
COLD, WARM, AMBIENT = 24.0, 40.0, 42.0
"""°C at the session's start, at most, and what the joint would come to."""
COEFFICIENT, PER_KELVIN = 20.0, -0.025
"""N·m·s/rad at `COLD`, and what of it a kelvin takes."""
THERMAL = Thermal(capacity_j_k=4000.0, resistance_k_w=0.02, loss_w_nm2=0.0, ambient_c=AMBIENT, initial_c=COLD)
"""Its surroundings warm it, with a time constant of 80 s; friction hardly does."""


def warmth(t: Array) -> Array:
    """°C at s since the session's start."""
    return AMBIENT - (AMBIENT - COLD) * np.exp(-t / (THERMAL.capacity_j_k * THERMAL.resistance_k_w))


@pytest.fixture(scope="module")
def session(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, list[Trajectory]]:
    urdf = tmp_path_factory.mktemp("grease") / "arm.urdf"
    prepared = prepare(Plan(1, 35700, "puma600", (), scatter=0.02, seconds=72.0), urdf)
    at_ambient = COEFFICIENT * (1.0 + PER_KELVIN * (AMBIENT - COLD))
    grease = Friction(
        joint=JOINT,
        level_nm=0.0,
        viscous_nms_rad=at_ambient,
        viscous_per_kelvin=COEFFICIENT * PER_KELVIN / at_ambient,
    )
    motors = [m.model_copy(update={"thermal": THERMAL} if m.joint == JOINT else {}) for m in prepared.hidden.motor]
    hidden = prepared.hidden.model_copy(update={"friction": (grease,), "motor": tuple(motors)})
    random, recordings = np.random.default_rng(4), []
    for run in play(prepared.installation, hidden, prepared.playlist, prepared.seed):
        kept = as_recorded(run, prepared.installation, random, prepared.every, prepared.jitter_s)
        temperature = np.full(kept.q.shape, np.nan)
        temperature[:, prepared.installation.joint_names.index(JOINT)] = np.round(warmth(kept.t), 1)
        recordings.append(Trajectory(kept.t - kept.t[0], kept.q, kept.tau, temperature=temperature, name=run.motion))
    return urdf, recordings


@pytest.mark.timeout(600)
def test_it_is_told_at_both_temperatures_and_is_no_noise(session: tuple[Path, list[Trajectory]]) -> None:
    urdf, recordings = session
    learning, judging = (
        [one for one in recordings if one.name.startswith(HELD_OUT) is held_out] for held_out in (False, True)
    )
    found = diagnose(load_rigid_body(urdf.read_text()), learning, judging)
    (drift,) = found.findings
    assert (drift.effect, found.joints[drift.place.joint or 0], drift.status) == ("friction_drift", JOINT, "named")
    assert not found.unexplained
    assert found.held_out.share_of_explainable > 0.95
    told = {name: (float(p.value), float(p.standard_error or 0.0)) for name, p in drift.parameters.items()}
    for end in ("initial", "final"):
        warmer_by = told[f"{end}_temperature"][0] - COLD
        value, error = told[f"{end}_coefficient"]
        assert abs(value - COEFFICIENT * (1.0 + PER_KELVIN * warmer_by)) < 3.0 * error
        assert error < 0.03 * COEFFICIENT


@pytest.mark.timeout(600)
def test_what_drifts_is_no_noise_either_where_nothing_tells_how_warm_it_was(
    session: tuple[Path, list[Trajectory]],
) -> None:
    urdf, recordings = session
    body, unknown = load_rigid_body(urdf.read_text()), [replace(one, temperature=None) for one in recordings]
    with_it, without = (gather(body, some, 0.05) for some in (recordings, unknown))
    assert (with_it.design.restless, without.design.restless) == ((), (1,))
    assert without.noise.rms[1] < 1.5 * with_it.noise.rms[1]


@pytest.mark.timeout(600)
def test_without_its_temperature_it_falls_with_time_and_is_another_one_in_each_recording(
    session: tuple[Path, list[Trajectory]],
) -> None:
    urdf, recordings = session
    found = diagnose(load_rigid_body(urdf.read_text()), [replace(one, temperature=None) for one in recordings])
    (friction,) = found.findings
    assert any("the friction of joint2 is another one in each recording" in note for note in found.notes)
    assert (friction.effect, friction.place.joint) == ("friction_drift", 1)
    # That it falls within a recording as well may be left open.
    assert {a.effect for a in friction.alternatives if a.log_likelihood_gap < AMBIGUOUS} <= {"viscous_friction"}
    assert found.verdict in ("named", "ambiguous")
    assert {left.signature for left in found.unexplained.values()} == {RESTLESS}
    initial, final = (friction.parameters[f"{end}_coefficient"] for end in ("initial", "final"))
    warmest = COEFFICIENT * (1.0 + PER_KELVIN * (WARM - COLD))
    assert warmest < float(final.value) < float(initial.value) < COEFFICIENT
    # By as much as recordings differ, and no less.
    assert (COEFFICIENT - warmest) / 20.0 < float(final.standard_error or 0.0) < (COEFFICIENT - warmest) / 4.0
