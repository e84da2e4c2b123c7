"""The fault matrix once more on SocketCAN, in the guest's virtual time: the same outcomes within the same cycles."""

from __future__ import annotations

import os

import pytest

from tests.faults.on_socketcan import ALL, IN_VIRTUAL_TIME, PART, run_on_socketcan
from tests.faults.scenarios import Scenario

pytestmark = [
    pytest.mark.vcan,
    pytest.mark.timeout(600),
    pytest.mark.skipif(
        not IN_VIRTUAL_TIME, reason="bounds in cycles are of virtual time: tests/vcan/guest -- pytest …"
    ),
]
SCENARIOS = ALL if os.environ.get("ETUDE_FAULTS") == "full" else [s for s in ALL if s.name in PART]


@pytest.mark.parametrize("scenario", SCENARIOS, ids=lambda s: f"{s.family}: {s.name}")
def test_fault(scenario: Scenario) -> None:
    seen = run_on_socketcan(scenario)
    assert not seen.problems, f"{seen.problems}; it said: {seen.sentence}"


def test_the_part_is_of_every_family() -> None:
    names = {s.name for s in ALL}
    assert names >= PART
    assert {s.family for s in ALL} == {s.family for s in ALL if s.name in PART}
