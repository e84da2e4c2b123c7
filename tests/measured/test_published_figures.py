"""Recordings of real arms, made elsewhere: read in place, skipped where they are not."""

from __future__ import annotations

import pytest

from benchmarks.measured import emps, is_here, kinova, kuka, panda, whole_panda
from estimator import LinkOptions, identify_links
from estimator.links import Prior
from estimator.prediction import torque_history


def needs(folder: str) -> None:
    if not is_here(folder):
        pytest.skip(f"{folder} is not in ../shared/data")


def test_panda_beats_the_published_fit() -> None:
    """Published: 1.41 % on the same samples, by classical least squares."""
    needs("franka_panda")
    recording = whole_panda()
    found = identify_links(panda().body, [recording])
    assert found.base.rank == 43
    assert found.status == "identified"
    assert found.fit.relative_error < 1.0
    assert found.band == pytest.approx(5.0, rel=0.05)
    # With the measured torques as they are, noise and all, at the full rate: 2.8 %.
    assert torque_history(found, recording).relative_error < 3.2


def test_panda_predicts_motion_it_has_not_seen() -> None:
    needs("franka_panda")
    arm = panda()
    found = identify_links(arm.body, arm.training, hold_out=arm.judging)
    assert found.hold_out is not None
    assert found.hold_out.relative_error < 1.41


def test_emps_meets_the_published_figures() -> None:
    """Published for the symmetric model, 40 Hz low-pass: M 95.1 kg, Fv 203.5 N·s/m, Fc 20.4 N, offset −3.2 N;
    4.0834 % where it was identified, 5.9824 % on the pulses."""
    needs("emps")
    arm = emps()
    found = identify_links(arm.body, arm.training, LinkOptions(band_hz=40.0), hold_out=arm.judging)
    assert found.fit.relative_error <= 4.0834
    assert found.hold_out is not None
    assert found.hold_out.relative_error <= 5.9824
    values = {term.name: value for term, value in zip(found.terms, found.value[1:], strict=True)}
    assert found.beta[0] == pytest.approx(95.1, abs=0.5)
    assert values["viscous_friction"] == pytest.approx(203.5, abs=8.0)
    assert values["coulomb_friction"] == pytest.approx(20.4, abs=0.6)
    assert values["torque_offset"] == pytest.approx(-3.16, abs=0.2)


def test_kinova_with_seconds_of_motion_needs_and_gets_its_prior() -> None:
    """4.5 s for 43 base parameters: the fit alone predicts no other motion, with the URDF's inertias it does."""
    needs("kinova_gen3")
    arm = kinova()
    body, (short, other, _) = arm.body, arm.recordings.values()
    options = LinkOptions(band_hz=5.0)
    alone = identify_links(body, [short], options, hold_out=[other])
    informed = identify_links(body, [short], options, hold_out=[other], prior=Prior(body.prior(), 1.0))
    assert alone.hold_out is not None
    assert informed.hold_out is not None
    assert alone.fit.relative_error < 5.0
    assert alone.hold_out.relative_error > 3.0 * informed.hold_out.relative_error
    assert informed.hold_out.relative_error < 10.0


def test_a_sliding_axis_is_told_in_newtons() -> None:
    needs("emps")
    arm = emps()
    answer = identify_links(arm.body, arm.training, hold_out=arm.judging).as_json()
    assert {effect["unit"] for effect in answer["effects"]} == {"N", "N·s/m"}
    assert [parameter["unit"] for parameter in answer["base_parameters"]] == ["kg"]
    assert answer["torque_residual"]["axis"]["unit"] == answer["hold_out"]["axis"]["unit"] == "N"


def test_kuka_predicts_motion_it_has_not_seen() -> None:
    """Kinematics alone are known of this arm: no masses, no inertias. Without leaving out what friction holds at rest
    it is 14 % where it was learnt and 16 % held out."""
    needs("kuka_kr300")
    arm = kuka()
    found = identify_links(arm.body, arm.training, hold_out=arm.judging)
    assert found.status == "identified"
    assert found.fit.relative_error < 2.5
    assert found.hold_out is not None
    assert found.hold_out.relative_error < 3.0
