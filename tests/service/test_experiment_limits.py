"""What an arm given as a URDF may do, by its recordings."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.encoder_steps import encoder_steps
from estimator.rigid_body import RigidBody, load_rigid_body
from estimator.trajectory import Trajectory
from service.diagnosis.experiment_limits import limits_of_urdf

Array = NDArray[np.float64]
URDF = """<robot name="arm"><link name="base"/>
<joint name="axle" type="continuous"><parent link="base"/><child link="arm"/><axis xyz="0 0 1"/></joint>
<link name="arm"><inertial><mass value="1"/>
<inertia ixx="1" iyy="1" izz="1" ixy="0" ixz="0" iyz="0"/></inertial></link></robot>"""
T = np.arange(2000) / 200.0


def recorded(q: Array) -> Trajectory:
    return Trajectory(T, q[:, None], np.zeros((len(q), 1)))


def limits(q: Array) -> tuple[Array, Array, Array, Array, Array]:
    body: RigidBody = load_rigid_body(URDF)
    found, home = limits_of_urdf(body, [recorded(q)])
    assert found is not None
    return found.lower, found.upper, found.velocity, found.acceleration, home


def test_missing_samples_do_not_matter() -> None:
    """Nor what lies between the parts of a recording that they part."""
    whole = np.sin(2.0 * T)
    parted = whole.copy()
    parted[1003:1011] = np.nan
    for found, true in zip(limits(parted), limits(whole), strict=True):
        np.testing.assert_allclose(found, true, rtol=0.05, atol=0.02)


def test_an_encoder_s_step_is_seen_beside_missing_samples() -> None:
    whole = np.round(np.sin(2.0 * T) / 1e-3) * 1e-3
    parted = whole.copy()
    parted[1003:1011] = np.nan
    np.testing.assert_allclose(encoder_steps([recorded(parted)]), 1e-3, rtol=1e-6)
