"""Torque constant, friction and rotor between a motor and its joint's sensor, on a twin of known truth."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.drive_train import drive_trains

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]
GAIN, COULOMB, VISCOUS, ROTOR = 0.9, 2.0, 3.0, 0.4


@pytest.fixture(scope="module")
def pairs(dda: RigidBody, make_periodic: Periodic) -> list[tuple[Trajectory, Trajectory]]:
    """Two motions with the motors' torques, with friction and rotors, and those of noisy sensors, without."""
    result = []
    for seed in range(2):
        random = np.random.default_rng(seed)
        t, q, dq, ddq = make_periodic(3, 12.0, 500.0, seed)
        felt = inverse_dynamics(dda, dda.prior(), q, dq, ddq)
        driven = (felt + COULOMB * np.sign(dq) + VISCOUS * dq + ROTOR * ddq) / GAIN
        q = q + random.normal(0.0, 1e-5, q.shape)
        noise = 0.02 * np.abs(felt).max(axis=0) * random.normal(size=(2, *q.shape))
        result.append((Trajectory(t, q, driven + noise[0]), Trajectory(t, q, felt + noise[1])))
    return result


def test_all_four_are_found_within_their_errors(pairs: list[tuple[Trajectory, Trajectory]]) -> None:
    for found in drive_trains([motor for motor, _ in pairs], [sensor for _, sensor in pairs]):
        assert found is not None
        estimates = (found.torque_constant, found.coulomb, found.viscous, found.rotor_inertia)
        for estimate, truth in zip(estimates, (GAIN, COULOMB, VISCOUS, ROTOR), strict=True):
            assert abs(estimate.value - truth) < 4.0 * estimate.standard_error + 0.02 * truth
        assert found.torque_constant.told
        assert found.torque_constant.standard_error < 0.02
        assert found.left < 0.1


def test_nothing_but_noise_between_them_is_told(pairs: list[tuple[Trajectory, Trajectory]]) -> None:
    sensors = [sensor for _, sensor in pairs]
    noisy = [replace(s, tau=s.tau + np.random.default_rng(9).normal(0.0, 1.0, s.tau.shape)) for s in sensors]
    for found in drive_trains(noisy, sensors):
        assert found is not None
        assert found.torque_constant.value == pytest.approx(1.0, abs=0.02)
        assert sum(estimate.told for estimate in (found.coulomb, found.viscous, found.rotor_inertia)) <= 1


def test_a_dead_sensor_and_strangers_are_told(pairs: list[tuple[Trajectory, Trajectory]]) -> None:
    (motor, sensor), (other, _) = pairs
    dead = sensor.tau.copy()
    dead[:, 1] = 0.0
    assert [x is None for x in drive_trains([motor], [replace(sensor, tau=dead)])] == [False, True, False]
    late = replace(other, t=other.t + 1.0)
    with pytest.raises(InputError, match="is not the recording"):
        drive_trains([late], [sensor])
