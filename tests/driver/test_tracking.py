"""An angle that jumps is told from one that went on while nobody looked."""

from __future__ import annotations

import math

import pytest

from config import Installation
from driver.cia402.pdo import Feedback
from driver.cyclic.feedback import ArmFeedback
from driver.cyclic.gate import OVERSPEED
from driver.cyclic.tracking import Tracking

OPERATING = 0x1237


class Watched:
    """A tracking that is shown joints one cycle after another; the first joint moves, the others stand."""

    def __init__(self, installation: Installation) -> None:
        self.joints = len(installation.joint)
        self.period_ns = installation.cycle.period_ns
        self.fastest = OVERSPEED * installation.joint[0].limits.velocity_rad_s * self.period_ns * 1e-9
        """rad a period."""
        self._tracking, self._feedback, self._now_ns = Tracking(installation), ArmFeedback(self.joints), 0

    def jumps(self, angle: float, periods: int = 1, *, heard: bool = True) -> bool:
        """Whether this angle, so many periods after the last one, is called a jump. ``heard`` False: it is lost."""
        self._now_ns += periods * self.period_ns
        nan, rest = math.nan, self.joints - 1
        first = (True, OPERATING, angle) if heard else (False, -1, nan)
        q, still = [first[2], *[0.0] * rest], [0.0] * self.joints
        words = [first[1], *[OPERATING] * rest]
        self._feedback.take(Feedback([first[0], *[True] * rest], words, q, still, still), self._now_ns)
        found = self._tracking.look(self._feedback, [angle, *[0.0] * rest], following=True)
        assert all(astray.joint == 0 and "jumped" in astray.sentence for astray in found)
        return bool(found)


@pytest.fixture
def watched(dda: Installation) -> Watched:
    seen = Watched(dda)
    assert not seen.jumps(0.0)
    return seen


def test_from_cycle_to_cycle_a_joint_moves_by_what_its_speed_allows(watched: Watched) -> None:
    assert not watched.jumps(0.95 * watched.fastest)
    assert watched.jumps(2.2 * watched.fastest)


@pytest.mark.parametrize("stall", [2, 50])
def test_cycles_that_a_stall_skipped_are_time_to_move_on(watched: Watched, stall: int) -> None:
    assert not watched.jumps(0.95 * stall * watched.fastest, stall)
    assert watched.jumps((0.95 * stall + 1.25 * stall) * watched.fastest, stall)


def test_so_are_cycles_without_its_feedback(watched: Watched) -> None:
    for _ in range(4):
        assert not watched.jumps(0.0, heard=False)
    assert not watched.jumps(4.9 * watched.fastest)


def test_a_cycle_that_comes_early_takes_no_time_away(watched: Watched) -> None:
    """On the wall clock cycles begin a little early or late; a drive's angle is of its own tick."""
    assert not watched.jumps(0.0, 1)
    assert not watched.jumps(0.95 * watched.fastest, 0)
