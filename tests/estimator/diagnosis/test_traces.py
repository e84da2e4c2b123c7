"""What the pictures of a diagnosis are drawn from."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]


def test_a_cause_is_shown_against_its_quantity_at_the_same_instants(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> None:
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in range(2):
        t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 1] += 0.5 * dq[:, 1]
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + 0.1 * random.normal(size=q.shape)))
    found = diagnose(body, recordings)
    (signature,) = found.traces.signatures
    assert found.findings[0].effect == "viscous_friction"
    assert signature.law == pytest.approx(0.5 * signature.x, abs=0.02 * np.ptp(signature.law))
    assert np.corrcoef(signature.x, signature.measured)[0, 1] > 0.99
