"""Friction that falls behind the speed, by laws of papers that are not the finder's own."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]
Law = Callable[[Array], Array]
Diagnoser = Callable[[Law], Diagnosis]


def dry(dq: Array) -> Array:
    return np.asarray(np.sign(dq) * 0.8)


@pytest.fixture
def found(make_chain: Callable[..., RigidBody], make_periodic: Callable[..., tuple[Array, ...]]) -> Diagnoser:
    """Of two joints, the second with a friction of its speed, two playings of three motions."""

    def diagnosed(friction: Law) -> Diagnosis:
        body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(2, 8.0, 200.0, motion)
            tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
            tau[:, 1] += friction(dq[:, 1])
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + 0.05 * random.normal(size=q.shape)))
        return diagnose(body, recordings)

    return diagnosed


@pytest.mark.parametrize(
    ("viscous", "status"),
    [
        (lambda v: 1.5 * np.arctan(2.0 * v), "named"),
        (lambda v: 1.5 * np.tanh(v), "named"),
        # Nearer to a straight one, which wider frictions have.
        (lambda v: np.sign(v) * np.abs(v) ** 0.6, "ambiguous"),
    ],
    ids=["arc of a tangent", "hyperbolic tangent", "power"],
)
def test_it_is_told_as_a_bent_friction_beside_a_dry_one(found: Diagnoser, viscous: Law, status: str) -> None:
    diagnosis = found(lambda dq: dry(dq) + viscous(dq))
    told = {finding.effect: finding for finding in diagnosis.findings}
    assert set(told) == {"coulomb_friction", "viscous_friction"}
    assert not diagnosis.unexplained
    assert told["viscous_friction"].status == status
    value = {name: float(one.value) for name, one in told["viscous_friction"].parameters.items()}
    speeds = np.linspace(0.3, 2.0, 18)
    bend, sharpness = value["bend"], value["sharpness"]
    law = value["coefficient"] * speeds / (1.0 + (bend * speeds) ** sharpness) ** (1.0 / sharpness)
    level = float(told["coulomb_friction"].parameters["level"].value)
    np.testing.assert_allclose(level + law, dry(speeds) + viscous(speeds), rtol=0.03)


@pytest.mark.parametrize("friction", [lambda dq: dry(dq) + dq, lambda dq: dq], ids=["beside a dry one", "alone"])
def test_a_straight_one_is_not_bent(found: Diagnoser, friction: Law) -> None:
    viscous = next(f for f in found(friction).findings if f.effect == "viscous_friction")
    assert set(viscous.parameters) == {"coefficient"}
    assert abs(float(viscous.parameters["coefficient"].value) - 1.0) < 0.02


def test_a_drag_is_none(found: Diagnoser) -> None:
    """What grows more than the speed does has no name of a friction that grows less."""
    diagnosis = found(lambda dq: dry(dq) + dq + 0.3 * np.abs(dq) * dq)
    assert all("bend" not in finding.parameters for finding in diagnosis.findings)
    assert diagnosis.unexplained
