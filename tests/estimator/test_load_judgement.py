"""Recognition and verification keep their stated error rates; equal moments have no axes."""

from __future__ import annotations

from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator.loads import RigidLoad, recognise, rigid_load, verify
from estimator.loads.entries import load_warnings

Array = NDArray[np.float64]
CENTRE, INERTIA = np.array([0.001, -0.02, 0.047]), np.array([0.0024, 1e-4, 0.0, 0.0019, 0.0, 0.0006])
SPREAD = np.diag([3e-3] + [2e-4] * 3 + [2e-5] * 6) ** 2


def seen(load: RigidLoad, random: np.random.Generator) -> RigidLoad:
    error = np.sqrt(np.diag(SPREAD)) * random.normal(size=10)
    return RigidLoad(load.parameters + error, SPREAD, "seen")


def test_recognition_and_verification() -> None:
    mine = rigid_load(1.106, CENTRE, INERTIA, SPREAD)
    same, other = rigid_load(1.106, CENTRE, INERTIA, name="same"), rigid_load(1.3, CENTRE, INERTIA, name="other")
    assert recognise(mine, [same, other]).name == "same"
    assert recognise(mine, [other]).verdict == "unknown"
    assert recognise(mine, [same, rigid_load(1.107, CENTRE, INERTIA, name="twin")]).verdict == "ambiguous"
    assert verify(mine, same, 0.01, 0.001).verdict == "accepted"
    assert verify(mine, other, 0.01, 0.001).verdict == "rejected"
    assert verify(mine, same, 0.003, 0.001).verdict == "undecided"
    with pytest.raises(InputError, match="none"):
        recognise(mine, [])
    with pytest.raises(InputError, match="not positive"):
        verify(mine, same, 0.0, 0.001)


def test_known_loads_are_missed_and_confused_as_rarely_as_stated() -> None:
    random = np.random.default_rng(5)
    known = [
        rigid_load(1.106, CENTRE, INERTIA, name="a"),
        rigid_load(1.125, CENTRE, INERTIA, name="b"),
        rigid_load(1.106, CENTRE, 1.3 * INERTIA, name="c"),
    ]
    runs = 300
    missed = wrong = 0
    for k in range(runs):
        truth = known[k % 3]
        answer = recognise(seen(truth, random), known, false_rejection=0.05, calibration=0.0)
        missed += answer.p_values[truth.name] < 0.05
        wrong += answer.verdict == "recognised" and answer.name != truth.name
    assert 0.025 < missed / runs < 0.08
    assert wrong / runs < 0.02


def test_verification_errs_as_rarely_as_stated() -> None:
    random, runs = np.random.default_rng(6), 300
    nominal = rigid_load(1.106, CENTRE, INERTIA, name="nominal")
    edge = rigid_load(1.126, CENTRE, INERTIA)
    verdicts = [verify(seen(edge, random), nominal, 0.02, 0.003).verdict for _ in range(runs)]
    assert verdicts.count("accepted") / runs < 0.05 + 0.025
    assert verdicts.count("rejected") / runs < 0.05
    good = [verify(seen(nominal, random), nominal, 0.02, 0.003) for _ in range(runs)]
    accepted = sum(v.verdict == "accepted" for v in good) / runs
    assert accepted >= good[0].power - 0.03
    assert good[0].power > 0.9


def test_equal_moments_have_no_axes() -> None:
    cube = rigid_load(1.0, CENTRE, np.array([1e-3, 0.0, 0.0, 1e-3, 0.0, 1e-3]), SPREAD)
    assert not cube.principal_axes.told.any()
    assert any("equal within their errors" in warning for warning in load_warnings(cube))
    bar = rigid_load(1.0, CENTRE, np.array([0.024, 0.0, 0.0, 0.0007, 0.0, 0.024]), SPREAD)
    assert bar.principal_axes.told.tolist() == [False, False, True]
    np.testing.assert_allclose(np.abs(bar.principal_axes.value[2]), [0.0, 1.0, 0.0], atol=1e-6)


@pytest.mark.parametrize(
    ("inertia", "said"),
    [((1e-3, 0.0, 0.0, 1e-4, 0.0, 1e-4), "no real body"), ((1e-5, 0.0, 0.0, 1e-5, 0.0, 1e-5), "errors of zero")],
)
def test_impossible_and_hidden_moments_are_told(inertia: Any, said: str) -> None:
    load = rigid_load(1.0, np.zeros(3), np.array(inertia), SPREAD)
    assert any(said in warning for warning in load_warnings(load))
