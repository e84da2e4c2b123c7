"""Ripple and cogging are told from what practice added, and nothing is told where there is none."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import load_installation
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from learner.cosine_spectrum import frequencies, low_pass, to_history, to_lines
from learner.local_model import LocalModel, States, ways
from learner.periodic_torques import periodic_torques
from service.identification.arm_source import of_installation
from service.practice.planning import practised_motion

Array = NDArray[np.float64]
BAND_HZ = 60.0


@pytest.fixture(scope="module")
def arm() -> ArmModel:
    installation = load_installation("dda")
    return ArmModel(of_installation(installation).rigid_body(installation.joint_names, {}))


@pytest.fixture(scope="module")
def motion() -> tuple[Array, Array, Array, float]:
    r = practised_motion("dda-practice", load_installation("dda"), "csp").reference
    return r.q[r.moving], r.dq[r.moving], r.ddq[r.moving], r.period


def smooth_and_noise(q: Array, dq: Array, period: float, seed: int) -> Array:
    """What practice adds besides: friction that the model lacks, and the band's share of the noise."""
    rng = np.random.default_rng(seed)
    noise = low_pass(frequencies(len(q), period), BAND_HZ)[:, None] * rng.standard_normal(q.shape)
    return np.asarray(0.6 * np.tanh(dq / 0.3) + 0.1 * np.cos(q) + 0.15 * to_history(noise))


def test_orders_amplitudes_and_phases_come_back(arm: ArmModel, motion: tuple[Array, Array, Array, float]) -> None:
    q, dq, ddq, period = motion
    hidden = (
        FittedEffect("torque_ripple", Place(0), {"order": 30.0, "amplitude": 0.02, "phase": 0.7}),
        FittedEffect("torque_ripple", Place(2), {"order": 30.0, "amplitude": 0.08, "phase": -0.4}),
        FittedEffect("cogging", Place(2), {"order": 52.0, "amplitude": 0.2, "phase": 1.9}),
    )
    there = ArmModel(arm.body, hidden).at_rate(1.0 / period).torque(q, dq, ddq)
    wanted = there - arm.at_rate(1.0 / period).torque(q, dq, ddq)
    found = periodic_torques(arm, q, dq, ddq, wanted + smooth_and_noise(q, dq, period, 1), period, BAND_HZ)
    assert {(one.name, one.place) for one in found} == {(one.name, one.place) for one in hidden}
    explained = ArmModel(arm.body, found).at_rate(1.0 / period).torque(q, dq, ddq)
    explained -= arm.at_rate(1.0 / period).torque(q, dq, ddq)
    left = np.sqrt(np.mean((wanted - explained) ** 2, axis=0))
    assert left[0] < 0.15 * wanted[:, 0].std()
    assert left[2] < 0.15 * wanted[:, 2].std()


@pytest.mark.parametrize("seed", range(8))
def test_an_arm_without_periodic_torques_gets_none(
    arm: ArmModel, motion: tuple[Array, Array, Array, float], seed: int
) -> None:
    q, dq, ddq, period = motion
    added = smooth_and_noise(q, dq, period, seed)
    assert np.sqrt(np.mean(to_lines(added) ** 2)) > 0.1
    assert periodic_torques(arm, q, dq, ddq, added, period, BAND_HZ) == ()


def test_ways_lead_from_reversal_to_reversal() -> None:
    t = np.linspace(0.0, 3.0 * np.pi, 601)
    q = np.pad(1.0 - np.cos(t), (50, 70), mode="edge")
    direction, done = ways(q, np.pad(np.sin(t), (50, 70)), 0.02)
    assert (direction[:240] == 1.0).all()
    assert (direction[260:440] == -1.0).all()
    assert (direction[460:] == 1.0).all()
    assert done[0] == 0.0
    assert done[49] == 0.0
    assert done[150] == pytest.approx(0.5, abs=0.01)
    assert done[-1] == pytest.approx(1.0)
    still, _ = ways(q, np.zeros_like(q), 0.02)
    assert not still.any()


def test_what_holds_before_one_direction_is_not_believed_before_the_other() -> None:
    """A joint that stands before it goes, where it was practised to stand before it goes the other way."""
    u = np.linspace(0.0, 1.0, 400)[:, None]
    q = np.pad(u**3 * (10 - 15 * u + 6 * u**2), ((60, 60), (0, 0)), mode="edge")
    dq, ddq = (np.gradient(q, 2.5e-3, axis=0), np.gradient(np.gradient(q, 2.5e-3, axis=0), 2.5e-3, axis=0))
    correction = np.where(np.arange(len(q))[:, None] < 100, -1.2, 0.1)
    local = LocalModel(States(q, dq, ddq), correction)
    same, trust = local.correction_at(States(q + 0.02, dq, ddq))
    assert trust[:60].min() > 0.99
    np.testing.assert_allclose(same[:60], -1.2, atol=1e-6)
    back, distrust = local.correction_at(States(q[::-1], -dq[::-1], ddq[::-1]))
    assert not back.any()
    assert not distrust.any()
