"""Reading a URDF: order of parameters, held joints, and what is refused."""

from __future__ import annotations

from pathlib import Path

import numpy as np
import pinocchio as pin
import pytest

from config import InputError
from estimator import RigidBody, inverse_dynamics, load_rigid_body
from estimator.rigid_body import to_thesis_order


def test_prior_is_the_cad_table_of_the_thesis(dda: RigidBody) -> None:
    link_2 = [53.01, 0.0, 3.4081, 16.6505, 7.9088, 0.0, 0.0, 7.6766, -1.5036, 0.6807]
    link_3 = [19.67, 0.3108, 0.0, 0.3268, 0.1825, 0.0, -0.0166, 0.4560, 0.0, 0.3900]
    np.testing.assert_allclose(dda.prior()[10:], link_2 + link_3, atol=2e-4)


def test_exchange_of_order_is_its_own_inverse() -> None:
    values = np.arange(20.0).reshape(2, 10)
    swapped = to_thesis_order(values)
    assert swapped[0, 6] == 7.0
    assert swapped[0, 7] == 6.0
    np.testing.assert_array_equal(to_thesis_order(swapped), values)


def test_names_carry_the_link_number(dda: RigidBody) -> None:
    assert dda.parameter_names[0] == "m1"
    assert dda.parameter_names[-1] == "Izz3"
    assert len(dda.parameter_names) == 30


def test_held_joints_keep_their_angle_and_load_their_carrier(six_axis: RigidBody) -> None:
    body = load_rigid_body(six_axis.urdf, joints=["j1", "j2", "j3"], hold={"j5": 0.7})
    assert body.joints == ("j1", "j2", "j3")
    assert body.held == {"j4": 0.0, "j5": 0.7, "j6": 0.0}
    q, dq, ddq = np.random.default_rng(0).normal(size=(3, 5, 3))
    still = np.zeros((5, 3))
    pose = np.column_stack([q, still])
    pose[:, 4] = 0.7
    whole = inverse_dynamics(
        six_axis, six_axis.prior(), pose, np.column_stack([dq, still]), np.column_stack([ddq, still])
    )
    np.testing.assert_allclose(inverse_dynamics(body, body.prior(), q, dq, ddq), whole[:, :3], atol=1e-9)


def test_gravity_can_point_elsewhere(six_axis: RigidBody) -> None:
    body = load_rigid_body(six_axis.urdf, gravity=(0.0, 9.81, 0.0))
    q = np.full(6, 0.3)
    expected = pin.computeGeneralizedGravity(body.model, body.model.createData(), q)
    zero = np.zeros((1, 6))
    np.testing.assert_allclose(inverse_dynamics(body, body.prior(), q[None], zero, zero)[0], expected, atol=1e-10)


def test_columns_follow_names_not_order(dda: RigidBody) -> None:
    assert dda.columns(["joint3", "wheel", "joint1", "joint2"]) == [2, 3, 0]
    with pytest.raises(InputError, match="'joint2' is missing"):
        dda.columns(["joint1", "joint3"])
    with pytest.raises(InputError, match="'joint1' is named twice"):
        dda.columns(["joint1", "joint2", "joint3", "joint1"])


@pytest.mark.parametrize(
    ("joints", "hold", "message"),
    [
        (["joint1", "elbow"], {}, "no moving joint 'elbow'"),
        (None, {"wrist": 0.0}, "no moving joint 'wrist'"),
        (["joint1", "joint1"], {}, "joint1 is named twice"),
        (["joint1"], {"joint1": 0.0}, "joint1 is named twice"),
        (None, {"joint1": 0.0, "joint2": 0.0, "joint3": 0.0}, "no joint that moves"),
    ],
)
def test_wrong_joints_are_named(dda: RigidBody, joints: list[str] | None, hold: dict[str, float], message: str) -> None:
    with pytest.raises(InputError, match=message):
        load_rigid_body(dda.urdf, joints=joints, hold=hold)


def test_files_that_are_no_urdf_are_named(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        load_rigid_body(tmp_path / "absent.urdf")
    (tmp_path / "broken.urdf").write_text("<robot name='x'><link")
    with pytest.raises(InputError, match=r"broken\.urdf: is not XML"):
        load_rigid_body(tmp_path / "broken.urdf")


def test_joints_of_several_degrees_of_freedom_are_refused(dda: RigidBody) -> None:
    floating = dda.urdf.replace('name="joint3" type="revolute"', 'name="joint3" type="floating"')
    with pytest.raises(InputError, match="'joint3' has 6 degrees of freedom"):
        load_rigid_body(floating)


def test_moments_without_a_mass_may_have_either_sign(dda: RigidBody) -> None:
    """Of a model without masses, links that fit best may come out so: possible or not, they are the answer."""
    parameters = np.zeros(30)
    parameters[[9, 19, 29]] = [0.1, -0.2, 0.3]
    np.testing.assert_allclose(dda.with_parameters(parameters).prior(), parameters)
