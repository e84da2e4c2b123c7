"""Whether what was left out bears a cause out: over whole motions, and over parts where one of them shows it alone."""

from __future__ import annotations

import numpy as np
import pytest

from estimator.diagnosis.borne_out import BORNE_OUT, in_errors, one_shows


@pytest.mark.parametrize(
    ("gains", "borne_out"),
    [
        ([5.0, 6.0, 4.0], True),
        ([2.0, 8.0, 3.0, 4.0, 230.0], True),
        ([0.2, -3.0, 0.5, 1.0, 230.0], False),
        ([4.0, 3.0, 230.0], False),
        ([-1.0, 2.0, -2.0, 1.0], False),
    ],
)
def test_the_others_bear_out_what_one_motion_shows_most_of(gains: list[float], borne_out: bool) -> None:
    """A motion that was designed to decide outweighs all others, and by itself bears nothing out."""
    assert (in_errors(np.array(gains)) > BORNE_OUT) is borne_out


@pytest.mark.parametrize(
    ("gains", "alone"),
    [
        ([0.2, -1.0, 0.5, 0.1, 230.0], True),
        ([0.2, -8.0, 0.5, 0.1, 230.0], False),
        ([3.0, 1.0, 5.0, 2.0, 8.0], False),
        ([-0.2, -0.1, -0.5], False),
    ],
)
def test_one_motion_shows_a_cause_that_the_others_do_not_speak_against(gains: list[float], alone: bool) -> None:
    assert one_shows(np.array(gains)) is alone
