"""The batched Newton–Euler regressor against pinocchio's, one sample at a time."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pinocchio as pin
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, inverse_dynamics, load_rigid_body, torque_regressor
from estimator.regressor import regressor_blocks
from estimator.rigid_body import to_thesis_order

Array = NDArray[np.float64]

TREE = """<robot name='tree'><link name='base'/>
{links}
<joint name='a' type='revolute'><parent link='base'/><child link='la'/><origin xyz='0 0 .4' rpy='.2 0 0'/>
<axis xyz='0 0 1'/><limit lower='-3' upper='3' velocity='3' effort='9'/></joint>
<joint name='b' type='revolute'><parent link='la'/><child link='lb'/><origin xyz='.1 0 .2' rpy='1 .3 0'/>
<axis xyz='0 1 0'/><limit lower='-3' upper='3' velocity='3' effort='9'/></joint>
<joint name='c' type='prismatic'><parent link='base'/><child link='lc'/><origin xyz='.3 .2 .1' rpy='0 .5 .2'/>
<axis xyz='1 0 0'/><limit lower='-3' upper='3' velocity='3' effort='9'/></joint>
<joint name='d' type='revolute'><parent link='lc'/><child link='ld'/><origin xyz='.1 .1 .1' rpy='.4 .5 .6'/>
<axis xyz='0 0 -1'/><limit lower='-3' upper='3' velocity='3' effort='9'/></joint></robot>""".format(
    links="".join(
        f"<link name='l{k}'><inertial><origin xyz='.1 .2 0'/><mass value='2'/>"
        "<inertia ixx='.1' ixy='0' ixz='0' iyy='.1' iyz='0' izz='.1'/></inertial></link>"
        for k in "abcd"
    )
)


def pinocchio_regressor(body: RigidBody, q: Array, dq: Array, ddq: Array) -> Array:
    data = body.model.createData()
    rows = [
        pin.computeJointTorqueRegressor(body.model, data, body.configuration(x), v, a).copy()
        for x, v, a in zip(q, dq, ddq, strict=True)
    ]
    return to_thesis_order(np.array(rows).reshape(len(q), body.n, body.n, 10)).reshape(len(q), body.n, -1)


def assert_as_pinocchio(body: RigidBody, samples: int = 40) -> None:
    q, dq, ddq = np.random.default_rng(7).normal(0.0, 2.0, (3, samples, body.n))
    np.testing.assert_allclose(
        torque_regressor(body, q, dq, ddq), pinocchio_regressor(body, q, dq, ddq), rtol=0.0, atol=1e-10
    )


def test_direct_drive_arm(dda: RigidBody) -> None:
    assert_as_pinocchio(dda)


@pytest.mark.parametrize(
    ("kinds", "aligned"), [("rrrrrr", True), ("rrrrrrr", False), ("rcprrp", False), ("p", True), ("r", False)]
)
def test_chains(make_chain: Callable[..., RigidBody], kinds: str, aligned: bool) -> None:
    assert_as_pinocchio(make_chain(kinds, aligned))


def test_branches() -> None:
    assert_as_pinocchio(load_rigid_body(TREE))


def test_torque_is_linear_in_the_prior(six_axis: RigidBody) -> None:
    q, dq, ddq = np.random.default_rng(2).normal(size=(3, 30, 6))
    data = six_axis.model.createData()
    expected = [pin.rnea(six_axis.model, data, *x) for x in zip(q, dq, ddq, strict=True)]
    np.testing.assert_allclose(inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq), expected, atol=1e-10)


@pytest.mark.parametrize("block", [1, 7, 64, 1000])
def test_block_size_does_not_matter(six_axis: RigidBody, block: int) -> None:
    q, dq, ddq = np.random.default_rng(3).normal(size=(3, 100, 6))
    whole = torque_regressor(six_axis, q, dq, ddq)
    seen = 0
    for rows, k in regressor_blocks(six_axis, q, dq, ddq, block):
        np.testing.assert_allclose(k.transpose(2, 0, 1), whole[rows], atol=1e-12)
        seen += k.shape[2]
    assert seen == 100


def test_no_samples(dda: RigidBody) -> None:
    nothing = np.zeros((0, 3))
    assert torque_regressor(dda, nothing, nothing, nothing).shape == (0, 3, 30)
