"""A law at a shape that no thing of its name has is no name."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]


def yielding(q: Array, way: float) -> Array:
    """(samples,) of an element that yields over a ``way`` (rad), by small steps along the angle."""
    force = np.zeros(len(q))
    for k, step in enumerate(np.diff(q), 1):
        force[k] = force[k - 1] + (step - abs(step) * force[k - 1]) / way
    return force


@pytest.fixture
def found(
    make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> Callable[[float], Diagnosis]:
    """Of an arm of two joints, the second of which pulls at such an element."""

    def of(way: float) -> Diagnosis:
        body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(2, 5.0, 500.0, motion)
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
            tau[:, 1] += 0.8 * yielding(q[:, 1], way)
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + 0.6 * random.normal(size=q.shape)))
        return diagnose(body, recordings)

    return of


def test_friction_that_gives_over_a_small_way_is_presliding(found: Callable[[float], Diagnosis]) -> None:
    answer = found(0.05)
    (finding,) = answer.findings
    assert (answer.verdict, finding.effect, finding.place.joint) == ("named", "presliding", 1)
    told = finding.parameters
    assert float(told["level"].value) / float(told["stiffness"].value) == pytest.approx(0.05, rel=0.2)
    assert answer.unexplained == {}


def test_what_gives_over_a_long_way_has_no_name(found: Callable[[float], Diagnosis]) -> None:
    answer = found(0.3)
    assert answer.verdict == "unknown"
    assert not any(finding.effect == "presliding" for finding in answer.findings)
    assert answer.unexplained[1].signature.startswith("a function of travel since reversals, as of a hose")
    assert 0 not in answer.unexplained
