"""What is certain about recordings of real rigs, and must be named: skipped where they are not."""

from __future__ import annotations

import numpy as np
import pytest

from benchmarks.bench_diagnose_measured import EMPS, FRICTION, ORDERS, pulses
from benchmarks.measured import emps, is_here
from benchmarks.measured.diagnosed import (
    diagnosed,
    emps_diagnosed,
    findings_of,
    kinova_drives,
    kuka_diagnosed,
    number,
    odrive_diagnosed,
    panda_diagnosed,
)
from estimator.convolution import convolve
from estimator.filtering import plan_filter


def needs(folder: str) -> None:
    if not is_here(folder):
        pytest.skip(f"{folder} is not in ../shared/data")


def test_emps_rubs_more_one_way_than_the_other() -> None:
    """Published: a fatigued screw. 3.11 % are left where the authors identified it, in a band of 40 Hz."""
    needs("emps")
    found = emps_diagnosed()
    first = found.findings[0]
    assert first.effect == "asymmetric_friction"
    assert first.status == "named"
    for name in ("coefficient_positive", "coefficient_negative"):
        unit, published = EMPS[name]
        assert first.parameters[name].unit == unit
        assert number(first, name) == pytest.approx(published, rel=0.06)
    assert found.torque_residual[0].unit == "N"
    assert found.detectable_units["coulomb_friction"] == "N"
    drawn = found.traces.signatures[0]
    assert (drawn.quantity, drawn.unit) == ("speed of axis", "m/s")
    assert (drawn.channel, drawn.channel_unit) == ("force of axis", "N")
    judged = emps().recordings["emps"]
    power = float(np.mean(convolve(judged.tau, plan_filter(judged.rate, found.band).smooth) ** 2))
    assert found.held_out.after < 0.032 * np.sqrt(power)


@pytest.mark.parametrize("learnt", [["emps"], ["emps", "emps_pulses"]])
def test_emps_rubs_more_one_way_whichever_motion_it_is_learnt_from(learnt: list[str]) -> None:
    """Its friction, and nothing else: what the pulses leave repeats at no order of the screw."""
    needs("emps")
    (finding,) = diagnosed(emps(), learnt).findings
    assert (finding.effect, finding.status) == ("asymmetric_friction", "named")
    for name in ("coefficient_positive", "coefficient_negative"):
        assert number(finding, name) == pytest.approx(EMPS[name][1], rel=0.06)


def test_emps_answers_its_pulses_as_a_rigid_mass_does() -> None:
    """Published: the pulses excite a flexibility. To 100 Hz there is none: a load on a spring would answer by
    1/(1 − f²/f₀²), which is beyond 1.04 for all springs up to 500 Hz."""
    needs("emps")
    (least, most) = pulses()
    assert 0.95 < least.value < most.value < 1.04


def test_a_motor_s_cogging_is_named_order_by_order() -> None:
    needs("odrive_cogging")
    found = odrive_diagnosed()
    lines = {number(one, "order"): number(one, "amplitude") for one in findings_of(found, "cogging")}
    strongest = max(lines, key=lambda order: lines[order])
    assert strongest == pytest.approx(7.0, abs=0.1)
    assert set(ORDERS) <= set(np.round(list(lines))), "the published ones"
    others = [lines[order] for order in lines if round(order) not in ORDERS]
    assert max(others) < 0.15 * lines[strongest], "harmonics and sums of the strong ones, far below them"


def test_the_panda_rubs_and_its_speeds_come_late() -> None:
    """Friction of every joint; no more causes than two a joint, offsets apart: with dry friction they are what a
    friction is that is not the same both ways."""
    needs("franka_panda")
    found = panda_diagnosed()
    rubbing = {f.place.joint for f in found.findings if f.effect in FRICTION}
    assert rubbing == set(range(7))
    late = [f for f in findings_of(found, "transport_delay") if f.place.channel == "velocity"]
    assert len(late) == 1
    assert number(late[0], "delay") == pytest.approx(5.4e-3, abs=1e-3)
    assert len(found.findings) - len(findings_of(found, "torque_offset")) <= 2 * len(found.joints)
    assert found.held_out.after < 0.6 * found.held_out.before


def test_the_kinova_s_currents_and_sensors_differ_by_friction() -> None:
    """Nothing is published: friction lies between them on every joint whose sensor speaks, and no other torque
    constant than the makers'."""
    needs("kinova_gen3")
    found = kinova_drives()
    assert {f.place.channel for f in found} == {"motor"}
    assert {f.place.joint for f in found if f.effect in FRICTION} >= {1, 2, 3, 4, 5, 6}
    assert not [f for f in found if f.effect == "torque_constant_error"]
    for finding in found:
        for name, quantity in finding.parameters.items():
            if finding.effect in FRICTION and name.startswith(("level", "breakaway")):
                assert 0.0 < float(np.asarray(quantity.value)) < 10.0, (finding.effect, finding.place)


def test_the_kuka_s_friction_is_named_on_every_axis() -> None:
    """Its URDF has no masses: what the recordings do not tell of its links must not decide."""
    needs("kuka_kr300")
    found = kuka_diagnosed()
    assert {f.place.joint for f in found.findings if f.effect in FRICTION} == set(range(6))
    assert found.held_out.after < 0.5 * found.held_out.before
