"""The model of an arm: rigid bodies and effects add up, and what only records late is not told to the motor."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator.arm_model import ArmModel, FittedEffect, fitted_effect, identified_model
from estimator.effects import Place, Signals
from estimator.links import LinkOptions, identify_links
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]
VISCOUS = FittedEffect("viscous_friction", Place(1), {"coefficient": 5.0})
OFFSET = FittedEffect("torque_offset", Place(2), {"offset": 1.5})
LATE = FittedEffect("transport_delay", Place(channel="torque"), {"delay": 0.02})


def test_effects_add_to_the_rigid_body(signals: Signals) -> None:
    s = signals
    torque = ArmModel(s.body, (VISCOUS, OFFSET)).torque(s.q, s.dq, s.ddq, s.t) - s.tau_rigid
    np.testing.assert_allclose(torque[:, 1], 5.0 * s.dq[:, 1])
    np.testing.assert_allclose(torque[:, 2], 1.5)
    assert not torque[:, [0, 3, 4, 5]].any()


def test_a_late_recording_does_not_delay_the_feedforward(signals: Signals) -> None:
    s = signals
    model = ArmModel(s.body, (VISCOUS, LATE))
    told = model.at_rate(1.0 / s.period).torque(s.q, s.dq, s.ddq)
    np.testing.assert_allclose(told, ArmModel(s.body, (VISCOUS,)).torque(s.q, s.dq, s.ddq, s.t))
    assert np.abs(model.torque(s.q, s.dq, s.ddq, s.t) - told).max() > 0.1


def test_an_effect_found_again_takes_the_old_one_s_place(arm: RigidBody) -> None:
    again = FittedEffect("viscous_friction", Place(1), {"coefficient": 6.0})
    elsewhere = FittedEffect("viscous_friction", Place(0), {"coefficient": 1.0})
    model = ArmModel(arm, (VISCOUS, OFFSET)).extended([again, elsewhere])
    assert model.effects == (OFFSET, again, elsewhere)


def test_the_sharpness_of_a_sign_is_kept(signals: Signals) -> None:
    """It is no parameter, but the fitted torque depends on it."""
    s, width = signals, 0.4
    fitted = fitted_effect("coulomb_friction", Place(1), np.array([width]), np.array([2.0]), {"level": 0.1})
    assert (fitted.parameters, fitted.standard_error) == ({"level": 2.0}, {"level": 0.1})
    np.testing.assert_allclose(fitted.torque(s)[:, 1], 2.0 * np.tanh(s.dq[:, 1] / width), atol=0.01)


def test_other_parameters_are_carried_by_the_body(arm: RigidBody, signals: Signals) -> None:
    parameters = arm.prior() * np.linspace(0.8, 1.2, 60)
    body = arm.with_parameters(parameters)
    np.testing.assert_allclose(body.prior(), parameters, atol=1e-12)
    s = signals
    np.testing.assert_allclose(
        ArmModel(body).torque(s.q, s.dq, s.ddq, s.t), inverse_dynamics(arm, parameters, s.q, s.dq, s.ddq), atol=1e-9
    )
    parameters[10:14] = 0.0, 0.1, 0.0, 0.0
    with pytest.raises(InputError, match="moments but no mass"):
        arm.with_parameters(parameters)


def test_identified_links_become_a_model(signals: Signals) -> None:
    """Of a noise-free motion with friction the identified model gives the torque again."""
    s = signals
    tau = s.tau_rigid + 2.0 * s.dq + 0.5
    found = identify_links(s.body, [Trajectory(s.t, s.q, tau, s.dq)], LinkOptions(band_hz=10.0))
    model = identified_model(found)
    assert {one.name for one in model.effects} >= {"viscous_friction"}
    error = model.torque(s.q, s.dq, s.ddq, s.t) - tau
    assert np.sqrt(np.mean(error**2)) < 1e-2 * np.sqrt(np.mean(tau**2))
