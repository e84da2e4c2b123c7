"""The same motion again is found and laid on itself; what differs is the noise that was put in."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import Trajectory
from estimator.recurrence import Piece, RecurrenceSearch
from estimator.repeats import aligned, find_repeats

Array = NDArray[np.float64]
Motion = Callable[[int, float, float, int], tuple[Array, ...]]


def angles(t: Array, seed: int, duration: float) -> Array:
    """A smooth motion of three joints that begins and ends at rest, at any times."""
    random = np.random.default_rng(seed)
    envelope = np.where((t > 0.0) & (t < duration), np.sin(np.pi * np.clip(t / duration, 0.0, 1.0)) ** 2, 0.0)
    waves = sum(
        random.normal(0.0, 0.4, 3) * np.sin(2 * np.pi * (k * t[:, None] / duration + random.random(3)))
        for k in range(1, 9)
    )
    return np.asarray(envelope[:, None] * waves)


def test_repetition_among_recordings_is_found_to_a_fraction_of_a_sample() -> None:
    random = np.random.default_rng(1)
    recordings, begins = [], (0.5, 0.5 + 0.0013, 0.9 - 0.0004)
    for begin, seed in zip((*begins, 0.5), (1, 1, 1, 2), strict=True):
        t = np.arange(0.0, 8.0, 0.002)
        q = angles(t - begin, seed, 6.0) + 1e-5 * random.normal(size=(len(t), 3))
        recordings.append(Trajectory(t + 17.0 * seed, q, np.zeros_like(q)))
    groups = find_repeats(recordings)
    assert len(groups) == 1
    (group,) = groups
    assert [o.trajectory for o in group.occurrences] == [0, 1, 2]
    assert group.duration > 5.0
    starts = np.array([o.start for o in group.occurrences])
    np.testing.assert_allclose(np.diff(starts), np.diff(begins), atol=1e-4)
    assert group.mismatch.max() < 1e-3


@pytest.mark.parametrize("lag", [0.0, -3e-17, 3e-17, 1.0 - 1e-16, -1.0 - 3e-16, 0.7, -0.7])
def test_a_lag_that_rounding_makes_is_within_both_recordings(lag: float) -> None:
    """Two recordings of a simulation are the same to the last digit."""
    t = np.arange(0.0, 8.0, 0.02)
    q = angles(t - 0.5, 1, 6.0)
    search = RecurrenceSearch([Piece(0, 0.0, q), Piece(1, 0.0, q)])
    first, last = search._shared(0, 1, lag)
    assert last - first >= len(q) - 5
    assert search._difference(0, 1, first, last, lag).shape == (last - first, 3)


def test_periods_of_one_recording_are_playings(make_periodic: Motion) -> None:
    _, q, _, _ = make_periodic(3, 5.0, 200.0, 3)
    many = np.tile(q, (4, 1))
    (group,) = find_repeats([Trajectory(np.arange(len(many)) / 200.0, many, np.zeros_like(many))])
    assert len(group.occurrences) == 4
    assert group.duration == pytest.approx(5.0, abs=0.1)
    np.testing.assert_allclose(np.diff([o.start for o in group.occurrences]), 5.0, atol=1e-4)


def test_passages_among_others_are_found_each_once() -> None:
    t = np.arange(0.0, 20.0, 0.004)
    q = angles(t - 0.5, 1, 4.0) + angles(t - 5.0, 2, 4.0) + angles(t - 9.7, 1, 4.0) + angles(t - 14.6, 2, 4.0)
    groups = find_repeats([Trajectory(t, q, np.zeros_like(q))])
    assert len(groups) == 2
    for group, apart in zip(groups, (9.2, 9.6), strict=True):
        first, second = group.occurrences
        assert second.start - first.start == pytest.approx(apart, abs=1e-3)
        assert group.duration > 3.0


def test_what_never_recurs_is_no_repetition(make_periodic: Motion) -> None:
    recordings = []
    for seed in range(4):
        t, q, _, _ = make_periodic(3, 10.0, 200.0, seed)
        recordings.append(Trajectory(t, q, np.zeros_like(q)))
    assert find_repeats(recordings) == []
    still = np.ones((4000, 3))
    assert find_repeats([Trajectory(np.arange(4000) / 200.0, still, still)] * 2) == []
    backwards = Trajectory(recordings[0].t, recordings[0].q[::-1], recordings[0].tau)
    assert find_repeats([recordings[0], backwards]) == []


@pytest.mark.parametrize("late", [0.0, 0.0023], ids=["on the grid", "between samples"])
@pytest.mark.parametrize("lacks", [0.0, 1.5], ids=["whole", "begins within the motion"])
@pytest.mark.parametrize("drift", [0.0, 4e-5], ids=["one clock", "two clocks"])
def test_what_differs_between_playings_is_the_noise_that_was_put_in(late: float, lacks: float, drift: float) -> None:
    """At all frequencies, whatever the playings share (here a large ripple), and wherever a channel begins."""
    random = np.random.default_rng(4)
    recordings = []
    for k in range(2):
        t = np.arange(0.0, 14.0, 0.004)
        q = angles((1.0 + k * drift) * t - 1.0 - k * late, 5, 12.0)
        recordings.append(Trajectory(t, q, 20.0 * np.sin(7.0 * q) + random.normal(size=q.shape)))
    (group,) = find_repeats(recordings)
    some = [r.t >= k * lacks for k, r in enumerate(recordings)]
    times, values = (
        [x[own] for x, own in zip(xs, some, strict=True)]
        for xs in zip(*[(r.t, r.tau) for r in recordings], strict=True)
    )
    _, stack = aligned(group, times, values)
    difference = stack[1] - stack[0]
    assert len(difference) > 2000
    power = np.mean(np.abs(np.fft.rfft(difference, axis=0)) ** 2, axis=1) / len(difference)
    bands = [float(band.mean()) for band in np.array_split(power[1:], 8)][:6]
    np.testing.assert_allclose(bands, 2.0, rtol=0.2)


def test_alignment_brings_a_shifted_channel_back() -> None:
    recordings = []
    for late in (0.0, 0.0031):
        t = np.arange(0.0, 9.0, 0.01)
        q = angles(t - 1.0 - late, 6, 7.0)
        recordings.append(Trajectory(t, q, np.sin(5.0 * q)))
    (group,) = find_repeats(recordings)
    rate, stack = aligned(group, [r.t for r in recordings], [r.tau for r in recordings])
    assert rate == pytest.approx(100.0)
    assert stack.shape[0] == 2
    assert np.abs(stack[1] - stack[0]).max() < 2e-2
    assert np.abs(recordings[1].tau - recordings[0].tau).max() > 10 * np.abs(stack[1] - stack[0]).max()
    with pytest.raises(IndexError):
        aligned(group, [recordings[0].t], [recordings[0].tau])
