"""A wider law stands beside those that it contains where chance would not explain so much more."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]


@pytest.mark.parametrize(("more_forwards", "status"), [(0.0, "named"), (0.018, "ambiguous")])
def test_friction_that_is_hardly_other_forwards_may_be_either(
    make_chain: Callable[..., RigidBody],
    make_periodic: Callable[..., tuple[Array, Array, Array, Array]],
    more_forwards: float,
    status: str,
) -> None:
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
        friction = 0.8 * np.sign(dq) + 0.5 * dq
        friction[:, 1] += more_forwards * np.maximum(dq[:, 1], 0.0)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + friction
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + 0.6 * random.normal(size=q.shape)))
    found = [f for f in diagnose(body, recordings).findings if f.place.joint == 1]
    assert {(f.effect, f.status) for f in found} == {("coulomb_friction", status), ("viscous_friction", status)}
    if status == "ambiguous":
        assert all([a.effect for a in f.alternatives] == ["asymmetric_friction"] for f in found)
