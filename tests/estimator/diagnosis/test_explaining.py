"""Which causes explain more than what is left: laws of one place that explain the same do not fall together."""

from __future__ import annotations

from collections.abc import Sequence
from types import SimpleNamespace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.diagnosis.naming import judging

Array = NDArray[np.float64]

LEFT = 10.0
"""Of the noise's variance, what the causes leave."""


class Shared:
    """Scores of causes in one channel of which each explains what it has alone, and all of them what they share."""

    def __init__(self, alone: Sequence[float], shared: float) -> None:
        self._alone, self._shared = alone, shared
        self.owner = np.arange(len(alone))
        self.design = SimpleNamespace(candidates=[SimpleNamespace(channels=(0,)) for _ in alone])

    def excess(self, chosen: Sequence[int]) -> Array:
        return np.array([1.0 + LEFT])

    def explained(self, causes: Sequence[int], others: Sequence[int]) -> Array:
        return np.array([sum(self._alone[k] for k in causes) + (0.0 if others else self._shared)])


@pytest.mark.parametrize(
    ("alone", "shared", "kept"),
    [
        ((2.0, 3.0), 100.0, [1]),
        ((2.0, 30.0), 100.0, [1]),
        ((20.0, 30.0), 100.0, [0, 1]),
        ((2.0, 3.0), 1.0, []),
    ],
    ids=["one of two", "the other's trifle", "both", "none"],
)
def test_what_two_explain_together_keeps_one_of_them(
    alone: Sequence[float], shared: float, kept: list[int], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setattr(judging, "beside_forms", lambda scores, chosen: chosen)
    monkeypatch.setattr(judging, "misfits", lambda scores, chosen: {})
    scores = Shared(alone, shared)
    assert judging._explaining(scores, scores, list(range(len(alone)))) == kept  # type: ignore[arg-type]
