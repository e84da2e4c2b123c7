"""Two slow lines of one joint, of which hardly a period is seen each: no line with an offset, a spring or a wall."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]


Pulleys = Callable[[float, float, float], Diagnosis]


@pytest.fixture
def pulleys(make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]) -> Pulleys:
    """What is found where two are out of round, of a ratio that is no fraction, at the first of two joints: of an
    order, a phase and an amplitude."""
    body = make_chain("rr")

    def found(order: float, phase: float, amplitude: float) -> Diagnosis:
        def law(q: Array, dq: Array) -> Array:
            waves = np.sin(order * q + phase) + np.sin(1.72 * order * q + 2.3 * phase)
            return np.asarray(np.array([amplitude, 0.0]) * waves)

        return diagnose(body, play_twice(body, law, noise=0.2))

    return found


@pytest.mark.parametrize(
    ("order", "phase", "amplitude"),
    [(1.8, 3.0, 0.4), (1.2, 0.0, 0.2), (1.2, 2.0, 0.4), (1.2, 4.0, 0.4), (1.2, 5.0, 0.4)],
)
def test_two_lines_are_no_line_beside_another_law(
    pulleys: Pulleys, order: float, phase: float, amplitude: float
) -> None:
    found = pulleys(order, phase, amplitude)
    assert [(f.effect, f.place.joint) for f in found.findings] == [("cogging", 0), ("cogging", 0)]
    assert found.unexplained == {}
    orders = [f.parameters["order"] for f in found.findings]
    for told, true in zip(sorted(orders, key=lambda one: float(one.value)), (order, 1.72 * order), strict=True):
        assert abs(float(told.value) - true) < max(3.5 * float(told.standard_error), 0.03)


# In the place of a ripple, twice, and of one with an eccentric encoder.
@pytest.mark.parametrize(("order", "phase", "amplitude"), [(2.4, 0.0, 0.05), (2.4, 5.0, 0.05), (1.8, 5.0, 0.1)])
def test_two_weak_lines_are_no_ripple(pulleys: Pulleys, order: float, phase: float, amplitude: float) -> None:
    """One of a torque that goes with the cosine of the angle is two lines itself."""
    found = pulleys(order, phase, amplitude).findings
    assert [(f.effect, f.place.joint, f.status) for f in found] == [("cogging", 0, "named")] * 2


def test_two_weak_lines_may_stand_for_two_other_laws_together(pulleys: Pulleys) -> None:
    """A spring and a wall."""
    found = pulleys(1.2, 1.0, 0.1).findings
    assert {f.status for f in found} == {"ambiguous"}
    assert all("cogging" in {f.effect, *(a.effect for a in f.alternatives)} for f in found)


def test_a_line_beside_an_offset_stays_what_it_is(
    make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]
) -> None:
    """Two lines explain no more than they do."""
    body = make_chain("rr")

    def line(q: Array, dq: Array) -> Array:
        return np.array([1.0, 0.0]) * (0.3 * np.sin(5.0 * q + 0.4) + 0.5)

    found = diagnose(body, play_twice(body, line, noise=0.2))
    assert {f.effect for f in found.findings} == {"cogging", "torque_offset"}
    (cogging,) = [f for f in found.findings if f.effect == "cogging"]
    assert cogging.parameters["order"].value == pytest.approx(5.0, abs=0.05)
