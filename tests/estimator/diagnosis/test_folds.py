"""What is left out: never one playing of a motion while another is learnt from."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.diagnosis.evidence.folds import Folds, folds_of, motions, parts_of
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.torques import share_of_explainable
from estimator.repeats import Occurrence, RepeatGroup

NONE: list[NDArray[np.float64]] = []


def group(*playings: tuple[int, float], duration: float = 10.0) -> RepeatGroup:
    return RepeatGroup(tuple(Occurrence(*playing) for playing in playings), duration, np.zeros(2))


def test_all_playings_of_a_motion_are_left_out_together() -> None:
    groups = [group((k, 0.0), (k + 4, 0.0)) for k in range(4)]
    blocks = [Block(recording, 50, NONE, middle) for recording in range(8) for middle in (2.5, 7.5)]
    assert motions(8, groups) == [0, 1, 2, 3, 0, 1, 2, 3]
    assert parts_of(8, groups) == 3
    folds = folds_of(blocks, 8, groups)
    assert folds.motions == (0, 0, 1, 1, 2, 2, 3, 3) * 2
    assert folds.parts == tuple(range(8)) * 2


def test_recordings_are_tied_through_others() -> None:
    assert motions(4, [group((0, 0.0), (1, 0.0)), group((1, 20.0), (3, 0.0))]) == [0, 0, 2, 0]
    assert motions(3, [group((2, 0.0), (1, 0.0)), group((1, 20.0), (0, 0.0))]) == [0, 0, 0]


def test_of_few_motions_the_same_part_of_every_playing_is_left_out() -> None:
    groups = [group((0, 1.0), (1, 3.0))]
    first = [Block(0, 50, NONE, 1.0 + at) for at in (1.5, 5.0, 8.5)]
    second = [Block(1, 50, NONE, 3.0 + at) for at in (1.5, 5.0, 8.5)]
    assert parts_of(2, groups) == 3
    assert folds_of([*first, *second, Block(1, 50, NONE, 20.0)], 2, groups) == Folds((0, 1, 2, 0, 1, 2, 3))


def test_periods_within_one_recording_are_playings_as_well() -> None:
    groups = [group((0, 0.0), (0, 9.0), (0, 18.0), duration=9.0)]
    blocks = [Block(0, 50, NONE, middle) for middle in np.arange(1.5, 27.0, 3.0)]
    assert folds_of(blocks, 1, groups) == Folds((0, 1, 2) * 3)


def test_motions_played_once_are_left_out_block_by_block_or_as_a_whole() -> None:
    blocks = [Block(recording, 50, NONE, middle) for recording in range(2) for middle in (2.0, 6.0)]
    assert folds_of(blocks, 2, []) == Folds((0, 1, 2, 3))
    blocks = [Block(recording, 50, NONE, middle) for recording in range(4) for middle in (2.0, 6.0)]
    assert folds_of(blocks, 4, []) == Folds((0, 0, 1, 1, 2, 2, 3, 3), tuple(range(8)))


def test_many_recordings_are_cut_into_fewer_parts() -> None:
    assert [parts_of(recordings, []) for recordings in (2, 4, 12, 13, 18, 19, 60)] == [3, 3, 3, 2, 2, 1, 1]


def test_a_noisy_joint_does_not_rule_the_share_of_the_explainable() -> None:
    before, after = np.array([1.2, 5.0]), np.array([1.2, 1.0])
    assert share_of_explainable(before, after, 0.1) == (5.0 - 1.0) / 4.2
    assert share_of_explainable(np.array([1.02, 0.99]), np.array([1.0, 0.99]), 0.1) is None
    assert share_of_explainable(np.array([2.0]), np.array([9.0]), 0.1) == -1.0
