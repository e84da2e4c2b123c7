"""Sets of parameters that bodies can have, and the texts made of them."""

from __future__ import annotations

from collections.abc import Callable

import mujoco
import numpy as np
import pinocchio as pin
import pytest

from config import InputError
from estimator import RigidBody, Trajectory, identify_links, load_rigid_body
from estimator.arm_model import identified_model
from estimator.consistency import (
    consistent_parameters,
    is_consistent,
    nearest_consistent,
    parameters_of,
    pseudo_inertia,
)
from estimator.export import model_mjcf, urdf_text


def off_prior(dda: RigidBody, seed: int = 1) -> np.ndarray:
    """A CAD model that is wrong by up to 30 % a link."""
    factor = np.random.default_rng(seed).uniform(0.7, 1.3, (3, 1))
    return (dda.prior().reshape(3, 10) * factor).ravel()


def test_pseudo_inertia_and_back() -> None:
    values = np.random.default_rng(0).normal(size=10)
    np.testing.assert_allclose(parameters_of(pseudo_inertia(values)), values, atol=1e-14)


def test_triangle_inequality_decides(dda: RigidBody) -> None:
    assert is_consistent(dda.prior()).all()
    broken = dda.prior()
    broken[9] = 2.5 * broken[4]
    assert is_consistent(broken).tolist() == [False, True, True]


def test_set_is_possible_and_keeps_the_base(dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]) -> None:
    found = identify_links(dda, measured_dda(0, torque_noise=0.3))
    prior = off_prior(dda)
    assert np.abs(found.base.combination @ (prior - dda.prior())).max() > 0.5
    result = consistent_parameters(found, prior)
    assert is_consistent(result.parameters).all()
    assert np.abs(result.misfit).max() < 0.05
    np.testing.assert_allclose(found.base.combination @ result.parameters, found.beta, atol=1e-3)


def test_a_true_prior_stays(dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]) -> None:
    base = identify_links(dda, measured_dda()).base
    result = nearest_consistent(base, base.combination @ dda.prior(), np.eye(15) * 1e-6, dda.prior())
    np.testing.assert_allclose(result.parameters[10:], dda.prior()[10:], rtol=1e-4, atol=1e-3)


def test_impossible_base_parameters_are_missed_not_obeyed(
    dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]
) -> None:
    base = identify_links(dda, measured_dda()).base
    beta = base.combination @ dda.prior()
    izz3 = base.names.index("Izz3")
    beta[izz3] = -0.2
    result = nearest_consistent(base, beta, np.eye(15) * 1e-4, dda.prior())
    assert is_consistent(result.parameters).all()
    assert result.misfit[izz3] > 10.0


def test_unmeasured_parameters_follow_the_prior(dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]) -> None:
    base = identify_links(dda, measured_dda()).base
    covariance = np.eye(15) * 1e-6
    covariance[0] = covariance[:, 0] = np.nan
    beta = base.combination @ dda.prior()
    beta[0] = 99.0
    result = nearest_consistent(base, beta, covariance, dda.prior())
    assert (base.combination @ result.parameters)[0] == pytest.approx((base.combination @ dda.prior())[0], rel=1e-3)


def test_prior_without_mass_is_refused(dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]) -> None:
    found = identify_links(dda, measured_dda())
    prior = dda.prior()
    prior[10] = 0.0
    with pytest.raises(InputError, match="link 2 has no mass"):
        consistent_parameters(found, prior)


def test_urdf_carries_the_parameters_and_nothing_else_changes(six_axis: RigidBody) -> None:
    body = load_rigid_body(six_axis.urdf, hold={"j6": 0.4})
    new = body.prior() * np.repeat([1.1, 1.0, 0.9, 1.2, 1.0], 10)
    again = load_rigid_body(urdf_text(body, new), hold={"j6": 0.4})
    np.testing.assert_allclose(again.prior(), new, atol=1e-12)
    for mine, theirs in zip(body.axes, again.axes, strict=True):
        np.testing.assert_array_equal(mine.rotation, theirs.rotation)
        np.testing.assert_array_equal(mine.translation, theirs.translation)


def test_impossible_parameters_are_not_exported(dda: RigidBody) -> None:
    parameters = dda.prior()
    parameters[20] = -1.0
    with pytest.raises(InputError, match="moved by joint3"):
        urdf_text(dda, parameters)


def test_mujoco_simulates_the_identified_arm(dda: RigidBody, measured_dda: Callable[..., list[Trajectory]]) -> None:
    recordings = measured_dda(0, torque_noise=0.2, viscous=(0.5, 0.2, 0.1), coulomb=(2.0, 1.0, 0.8))
    found = identify_links(dda, recordings)
    model = mujoco.MjModel.from_xml_string(model_mjcf(identified_model(found)))
    data = mujoco.MjData(model)
    data.qpos[:], data.qvel[:], data.qacc[:] = (2.0, 1.2, 0.7), (1.0, -2.0, 1.5), (3.0, 2.0, -4.0)
    mujoco.mj_inverse(model, data)
    friction = np.array([0.5, 0.2, 0.1]) * data.qvel
    rigid = pin.rnea(dda.model, dda.model.createData(), *(np.array(x) for x in (data.qpos, data.qvel, data.qacc)))
    # Joint friction is a constraint in MuJoCo; mj_inverse counts it with the sign of the velocity.
    dry = np.array([2.0, 1.0, 0.8]) * np.sign(data.qvel)
    np.testing.assert_allclose(data.qfrc_inverse, rigid + friction + dry, rtol=0.02, atol=0.5)
