"""What is left about one frequency, where the motion is not, is told as ringing."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.plainer import fitted
from estimator.diagnosis.naming.ringing import ringing

Array = NDArray[np.float64]
NOISE = 0.2
"""N·m, white."""


def swinging(t: Array) -> Array:
    """(samples,) N·m of a pendulum of 3 Hz that is pushed every three seconds."""
    since = t % 3.0
    return np.asarray(np.exp(-0.4 * since) * np.sin(2.0 * np.pi * 3.0 * since))


@pytest.mark.parametrize(
    ("left", "told"),
    [
        (lambda t, *_: swinging(t), True),
        (lambda *x: 0.1 * x[2], False),
        (lambda *x: x[1], False),
    ],
)
def test_the_frequency_is_told_of_what_rings_alone(
    make_chain: Callable[..., RigidBody],
    make_periodic: Callable[..., tuple[Array, Array, Array, Array]],
    left: Callable[[Array, Array, Array], Array],
    told: bool,
) -> None:
    """And not where what is left follows the motion, or lies at all frequencies."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(2, 10.0, 200.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 0] += left(t, 2.0 * NOISE * random.normal(size=len(t)), ddq[:, 0])
        for _ in range(2):
            noisy = tau + NOISE * random.normal(size=q.shape)
            recordings.append(Trajectory(t, q + 1e-7 * random.normal(size=q.shape), noisy))
    evidence = gather(body, recordings, 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds)
    found = [ringing(evidence, fitted(evidence, scores, []), joint) for joint in range(2)]
    assert found[1] is None
    assert (found[0] is not None and abs(found[0] - 3.0) < 0.2) if told else found[0] is None
