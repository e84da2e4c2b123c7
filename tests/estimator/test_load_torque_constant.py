"""Gains of joint torques against a load of known weight, and a joint that the load does not reach."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.loads import RigidLoad, rigid_load
from estimator.loads.torque_constant import torque_gains
from tests.estimator.loaded_arm import at_tool

Array = NDArray[np.float64]
LOAD = rigid_load(4.0, np.array([0.01, -0.02, 0.06]), np.array([0.02, 0.0, 0.0, 0.01, 0.0, 0.02]))
GAINS = np.array([1.0, 0.9, 1.12])


def measured(body: RigidBody, motion: tuple[Array, ...], seed: int, load: bool) -> Trajectory:
    """What drives with wrong torque constants say of joints that rub."""
    t, q, dq, ddq = motion
    psi = body.prior() + at_tool(body, LOAD) if load else body.prior()
    random = np.random.default_rng(seed)
    noise = 0.1 * random.normal(size=q.shape)
    true = inverse_dynamics(body, psi, q, dq, ddq) + 1.5 * np.tanh(dq / 0.01)
    seen = q + 3e-5 * random.normal(size=q.shape)
    return Trajectory(t, seen, true / GAINS + noise, name=f"recording {seed}")


def test_gains_come_back_with_their_errors(dda: RigidBody, make_periodic: Any) -> None:
    motion = make_periodic(3, 8.0, 500.0, 4)
    free, loaded = measured(dda, motion, 1, load=False), measured(dda, motion, 2, load=True)
    found = torque_gains(dda, "tool", LOAD, [loaded], [free])
    assert [g.joint for g in found] == list(dda.joints)
    for gain, truth in zip(found, GAINS, strict=True):
        assert abs(gain.gain - truth) < 4.0 * gain.standard_error
        assert gain.standard_error < 0.03
        assert gain.load_torque_rms > 1.0


def test_a_joint_that_stands_has_no_gain(dda: RigidBody, make_periodic: Any) -> None:
    t, q, dq, ddq = make_periodic(3, 8.0, 500.0, 4)
    for channel, rest in ((q, 2.0), (dq, 0.0), (ddq, 0.0)):
        channel[:, 0] = rest
    free, loaded = (measured(dda, (t, q, dq, ddq), seed, load) for seed, load in ((1, False), (2, True)))
    first, *others = torque_gains(dda, "tool", LOAD, [loaded], [free])
    assert np.isnan(first.gain)
    assert np.isinf(first.standard_error)
    assert all(np.isfinite(g.gain) for g in others)
    with pytest.raises(InputError, match="not known whole"):
        torque_gains(dda, "tool", RigidLoad(np.full(10, np.nan)), [loaded], [free])
