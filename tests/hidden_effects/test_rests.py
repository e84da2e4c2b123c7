"""Motions from point to point, with rests in which a joint's friction, five times the noise, holds it by any torque."""

from __future__ import annotations

import pytest

from benchmarks.campaign.campaign import judged
from benchmarks.campaign.finding import in_process
from benchmarks.campaign.plans import Plan

SEVERAL = ("load_dependent_friction", "friction_drift", "payload")


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "plan",
    [
        Plan(1, 35420, "puma600", ("torque_constant_error",), 0.4, 0.05, 30.0, friction=5.0, rests=True),
        Plan(9, 35420, "seven", SEVERAL, 1.0, 0.02, 30.0, friction=5.0, rests=True),
    ],
    ids=["torque constant", "several causes"],
)
def test_rests_of_joints_that_rub_are_evidence_of_nothing(plan: Plan) -> None:
    """They were an asymmetric friction beside a small cause; and a recording held out, in which a joint creeps
    between rests, was another arm's."""
    result = judged(plan, in_process)
    assert not result.wrong, result.sentence


@pytest.mark.timeout(600)
def test_a_line_of_which_no_period_is_seen_has_no_name() -> None:
    """What a load that swings leaves of a torque is a ripple of order 1.0 ± 2.5."""
    result = judged(Plan(14, 35420, "dda", ("sloshing_load",), 0.8, 0.0, 30.0, friction=5.0, rests=True), in_process)
    assert not result.wrong, result.sentence
    assert result.flagged, result.sentence
