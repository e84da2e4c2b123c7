"""The load while the arm moves: from the samples alone, and with loads that are known beforehand."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.loads import LiveLoad, RigidLoad, rigid_load

Array = NDArray[np.float64]
Told = list[tuple[str | None, float, float]]
LIMITS = np.array([200.0] * 3 + [20.0] * 3)
SAMPLES = 1000
JUG = rigid_load(1.9, np.array([0.0, 0.0, 0.1]), np.array([0.01, 0.0, 0.0, 0.01, 0.0, 0.004]), name="jug")


def block(arm: Any) -> RigidLoad:
    return rigid_load(arm.mass, arm.centre, arm.inertia, name="block")


def followed(arm: Any, known: list[RigidLoad], wrench: Array | None = None) -> Told:
    """(recognised, mass, its error) after each tenth of a second; NaN while there is no mass."""
    live = LiveLoad(arm.body, "tool", 200.0, LIMITS, known)
    dq = np.gradient(arm.q, arm.t, axis=0)
    true = arm.wrench if wrench is None else wrench
    seen = true + arm.offset + arm.noise * np.random.default_rng(4).normal(size=true.shape)
    told = []
    for begin in range(0, SAMPLES, 20):
        here = slice(begin, begin + 20)
        live.feed(arm.t[here], arm.q[here], dq[here], seen[here], arm.t[here])
        mass = live.mass
        told.append(
            (live.recognised, np.nan, np.nan)
            if mass is None
            else (live.recognised, float(mass.value), float(mass.standard_error))
        )
    return told


@pytest.fixture(scope="module")
def alone(loaded_puma: Any) -> Told:
    return followed(loaded_puma, [])


def test_the_mass_is_told_once_the_wrist_has_turned(loaded_puma: Any, alone: Told) -> None:
    arm, told = loaded_puma, alone
    assert {name for name, _, _ in told} == {None}
    masses = np.array([mass for _, mass, _ in told])
    first = int(np.argmax(np.isfinite(masses)))
    # At rest weight and offset are one.
    assert np.abs(arm.q[: np.searchsorted(arm.t, arm.t[0] + 0.3)] - arm.q[0]).max() < 1e-2
    assert first >= 3
    assert np.isfinite(masses[first:]).all()
    _, mass, error = told[-1]
    assert error < 0.05
    assert abs(mass - arm.mass) < 4.0 * error


def test_a_known_load_is_recognised_and_is_the_prior(loaded_puma: Any, alone: Told) -> None:
    arm = loaded_puma
    told = followed(arm, [JUG, block(arm)])
    names = [name for name, _, _ in told]
    first = names.index("block")
    assert set(names[:first]) == {None}
    assert set(names[first:]) == {"block"}
    for (_, _, without), (_, mass, error) in zip(alone[first:], told[first:], strict=True):
        assert error < without
        assert abs(mass - arm.mass) < 3.0 * error
    assert told[first][2] < 0.5 * alone[first][2]


def test_what_is_none_of_the_known_loads_is_weighed_as_if_nothing_were_known(loaded_puma: Any, alone: Told) -> None:
    arm = loaded_puma
    other = followed(arm, [JUG, rigid_load(1.5 * arm.mass, arm.centre, arm.inertia, name="other")])
    np.testing.assert_array_equal([x[1:] for x in other], [x[1:] for x in alone])
    # One that differs by less than the samples tell at first is refused as soon as they do.
    like = followed(arm, [rigid_load(1.1 * arm.mass, arm.centre, arm.inertia, name="like")])
    assert like[-1] == alone[-1]


def test_an_empty_wrist_is_no_known_load(loaded_puma: Any) -> None:
    arm = loaded_puma
    told = followed(arm, [block(arm)], np.zeros_like(arm.wrench))
    assert {name for name, _, _ in told} == {None}
    assert abs(told[-1][1]) < 4.0 * told[-1][2]


def test_of_a_load_without_inertia_mass_and_centre_are_the_prior(loaded_puma: Any) -> None:
    arm = loaded_puma
    known = block(arm)
    parameters, covariance = known.parameters.copy(), np.zeros((10, 10))
    parameters[4:] = np.nan
    covariance[4:], covariance[:, 4:] = np.nan, np.nan
    covariance[range(4, 10), range(4, 10)] = np.inf
    told = followed(arm, [RigidLoad(parameters, covariance, "block")])
    assert told[-1][0] == "block"
    assert told[-1][1] == pytest.approx(arm.mass, abs=3.0 * told[-1][2])


def test_it_begins_anew_after_a_gap(loaded_puma: Any) -> None:
    arm = loaded_puma
    dq = np.gradient(arm.q, arm.t, axis=0)
    known = []
    for gap in (0, 60):
        live = LiveLoad(arm.body, "tool", 200.0, LIMITS)
        keep = np.delete(np.arange(len(arm.t)), np.arange(700, 700 + gap))
        wrench = arm.wrench + arm.offset
        live.feed(arm.t[keep], arm.q[keep], dq[keep], wrench[keep], arm.t[keep])
        known.append(live.mass)
    assert known[1] is not None
    assert abs(known[1].value - arm.mass) < 0.02
    assert known[1].standard_error > known[0].standard_error
