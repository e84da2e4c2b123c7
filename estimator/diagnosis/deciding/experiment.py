"""What decides between the hypotheses that recordings leave: a motion, T-optimal within an arm's limits, or a reading
of the torques with the drives off."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from itertools import combinations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.deciding.contest import Contest
from estimator.diagnosis.deciding.experiment_motions import ExperimentMotion, family
from estimator.diagnosis.evidence.grams import Block
from estimator.excitation.limits import MotionLimits

Array = NDArray[np.float64]

DECIDED = 10.0
"""nats expected between two rivals that leave no doubt: a gap scatters by the square root of twice its size, so that
fewer than one in ten falls below the three nats within which rivals are as good as each other."""
UNDECIDED = 3.0
"""nats: pairs of which no motion promises more are beyond what the limits allow to tell."""
PLAYINGS = (2, 4, 8)
"""Times that a motion may be played: what differs between two is noise, and more make it smaller."""
READ_OFF_S = 15.0
"""Of a reading with the drives off, for each playing that a motion would have in its place."""


@dataclass(frozen=True)
class Experiment:
    """The chosen motion, or reading with the drives off, and what it promises.

    ``gaps`` (rivals, rivals): nats by which the column's rival will be behind the row's if the row's is the truth.
    ``told`` lists the pairs that something within the limits tells apart; ``alike`` those that nothing does.
    """

    motion: ExperimentMotion | None
    """None: the torques are to be read with the drives off."""
    playings: int
    """Times that the motion is to be played."""
    gaps: Array
    told: tuple[tuple[int, int], ...]
    alike: tuple[tuple[int, int], ...]

    @property
    def drives_off_s(self) -> float | None:
        """s for which the torques are to be read with the drives off; None for a motion."""
        return READ_OFF_S * self.playings if self.motion is None else None

    @property
    def predicted_gap(self) -> float:
        """nats of the worst pair that it tells apart, whichever of the two is the truth."""
        return min(pair_gap(self.gaps, pair) for pair in self.tells)

    @property
    def tells(self) -> tuple[tuple[int, int], ...]:
        """Of ``told``, what it tells apart by itself."""
        return tuple(pair for pair in self.told if pair_gap(self.gaps, pair) > UNDECIDED)

    @property
    def worst(self) -> float:
        """`predicted_gap` of all pairs that anything tells apart: negative, where data speak for the wrong one of a
        pair that it does not tell."""
        return min(pair_gap(self.gaps, pair) for pair in self.told)

    @property
    def decided(self) -> int:
        """Pairs that it leaves no doubt about."""
        return sum(pair_gap(self.gaps, pair) >= DECIDED for pair in self.told)


def pair_gap(gaps: Array, pair: tuple[int, int]) -> float:
    """The smaller of a pair's two expected gaps."""
    return float(min(gaps[pair], gaps[pair[::-1]]))


def design_experiment(
    contest: Contest, limits: MotionLimits, home: Array, seconds: float = 15.0, seed: int = 0
) -> Experiment | None:
    """The motion of the family that leaves fewest pairs of rivals undecided, and of those the one whose worst pair is
    told apart best; as few playings of it as leave so few. A reading with the drives off in its place, where there is
    none yet, and it leaves as few. None when nothing within the limits tells any pair apart.

    ``limits`` and ``home`` (n,) are in the order of the contest's body.
    """
    family_of = family(contest.design.body, limits, home, joints_of(contest), contest.band, seconds, seed)
    motions: list[ExperimentMotion | None] = list(family_of)
    if contest.design.reading is None:
        motions.append(None)
    best: Experiment | None = None
    for playings in PLAYINGS:
        gaps = [contest.expected_gaps(_planned(contest, motion, playings)) for motion in motions]
        found = _best(motions, playings, gaps, len(contest.rivals))
        # Where nothing is decided, the more the better.
        if found is not None and (best is None or found.decided > best.decided or not best.decided):
            best = found
        if best is not None and best.decided == len(best.told) + len(best.alike):
            break
    return best


def _planned(contest: Contest, motion: ExperimentMotion | None, playings: int) -> Block:
    if motion is None:
        return contest.planned_reading(READ_OFF_S * playings)
    return contest.planned(*motion.sampled(contest.rate), playings)


def _best(
    motions: Sequence[ExperimentMotion | None], playings: int, gaps: Sequence[Array], rivals: int
) -> Experiment | None:
    pairs = list(combinations(range(rivals), 2))
    most = {pair: max((pair_gap(own, pair) for own in gaps), default=0.0) for pair in pairs}
    told = tuple(pair for pair in pairs if most[pair] > UNDECIDED)
    if not told:
        return None
    alike = tuple(pair for pair in pairs if pair not in told)
    designed = [Experiment(motion, playings, own, told, alike) for motion, own in zip(motions, gaps, strict=True)]
    # Where it decides as much, what moves nothing comes first.
    return max(
        (one for one in designed if one.tells),
        key=lambda one: (one.decided, one.motion is None and one.decided > 0, one.worst),
    )


def joints_of(contest: Contest) -> tuple[int, ...]:
    """Joints that the rivals live in; all of them when none lives in a joint."""
    places = [rival.hypothesis.place for rival in contest.rivals]
    named = {joint for place in places for joint in (place.joint, place.other) if joint is not None}
    return tuple(sorted(named)) or tuple(range(contest.design.body.n))
