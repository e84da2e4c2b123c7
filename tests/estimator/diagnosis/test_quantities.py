"""Parameters with their errors."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest

from estimator import RigidBody
from estimator.diagnosis.evidence.design import Hypothesis
from estimator.diagnosis.telling.quantities import quantities
from estimator.effects import Place, effect


def test_a_part_of_a_law_that_is_next_to_nothing_has_its_error(make_chain: Callable[..., RigidBody]) -> None:
    """A dead zone of a billionth of its error is not there a step below."""
    hypothesis = Hypothesis(effect("torque_nonlinearity"), Place(0))
    covariance = np.diag([0.0, 0.0, 1e-8, 0.04])
    found = quantities(hypothesis, make_chain("r"), np.array([0.01, 1e-3]), np.array([1e-3, 2e-10]), covariance)
    assert found["dead_zone"].value == pytest.approx(2e-10)
    assert found["dead_zone"].standard_error == pytest.approx(0.2)
    assert found["limit"].standard_error == pytest.approx(found["limit"].value * 0.5 * 1e-4 / 1e-3)
