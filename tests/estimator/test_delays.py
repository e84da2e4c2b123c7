"""Injected delays, demanded back."""

from __future__ import annotations

from collections.abc import Callable

import pytest

from estimator import RigidBody, Trajectory
from estimator.delays import delayed, torque_delay, velocity_delay

Recordings = Callable[..., list[Trajectory]]
NOISE = {"torque_noise": 0.3, "velocity_noise": 1e-3, "viscous": (0.5, 0.2, 0.1), "coulomb": (2.0, 1.0, 0.8)}


@pytest.mark.parametrize("delay", [-0.003, 0.0, 0.002, 0.006])
def test_velocity_delay(measured_dda: Recordings, delay: float) -> None:
    found = velocity_delay([delayed(t, velocity=delay) for t in measured_dda(1, **NOISE)], band=10.0)
    assert found is not None
    assert found.value == pytest.approx(delay, abs=5e-5)


def test_no_velocity_no_delay(measured_dda: Recordings) -> None:
    recordings = [Trajectory(t.t, t.q, t.tau) for t in measured_dda(1)]
    assert velocity_delay(recordings, band=10.0) is None


@pytest.mark.parametrize("delay", [0.0, 0.006])
def test_torque_delay(dda: RigidBody, measured_dda: Recordings, delay: float) -> None:
    found = torque_delay(dda, [delayed(t, torque=delay) for t in measured_dda(2, **NOISE)], band=10.0)
    assert found.value == pytest.approx(delay, abs=2e-4)
    assert abs(found.value - delay) < 6.0 * found.standard_error


def test_taking_a_delay_back_restores_the_recording(measured_dda: Recordings) -> None:
    original = measured_dda(3)[0]
    there_and_back = delayed(delayed(original, torque=0.003), torque=-0.003)
    assert there_and_back.tau[500:1400] == pytest.approx(original.tau[500:1400], abs=0.05)
