"""The noise that is assumed where no motion was played again."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.diagnosis.noise import ORDER, assumed_noise


def test_columns_that_say_the_same_but_for_rounding_swallow_no_noise() -> None:
    """Directions that only rounding has would take noise away by chance, another share on every processor."""
    random = np.random.default_rng(0)
    columns, residual = random.normal(size=(20, 600)), random.normal(size=(1, 600))
    mixed = random.normal(size=(150, 20)) @ columns
    unseen = np.zeros((1, ORDER + 1))
    alone, doubled = (
        assumed_noise([[np.vstack([*rows, residual])]], unseen) for rows in ([columns], [columns, mixed, 3.0 * columns])
    )
    assert doubled.rms == pytest.approx(alone.rms, rel=1e-9)
    assert doubled.filters == pytest.approx(alone.filters, rel=1e-6, abs=1e-9)
