"""Angles that leap from one sample to the next: by whole turns, or damaged; and those that only look like it."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator.plausibility import about, leaps, turns

Array = NDArray[np.float64]
TURN = 2.0 * np.pi


@pytest.fixture
def t() -> Array:
    return np.arange(4000) / 200.0


@pytest.fixture
def q(t: Array) -> Array:
    """Two and a half turns there and back, with the noise of an encoder."""
    return 8.0 * np.sin(0.7 * t) + 1e-4 * np.random.default_rng(0).normal(size=len(t))


@pytest.mark.parametrize("modulus", [1, 2])
@pytest.mark.parametrize("missing", [0, 3])
def test_an_angle_told_within_a_turn_goes_on(q: Array, modulus: int, missing: int) -> None:
    within = (q + modulus * np.pi) % (modulus * TURN) - modulus * np.pi
    within[700 : 700 + missing] = np.nan
    whole = turns(within)
    assert np.array_equal(np.isnan(whole), np.isnan(within))
    there = np.isfinite(within)
    np.testing.assert_allclose(np.diff((within + TURN * whole)[there]), np.diff(q[there]), atol=1e-9)
    assert not np.any(turns(q))


def test_an_angle_at_the_edge_of_its_turn_goes_to_and_fro() -> None:
    still = np.pi + 1e-3 * np.random.default_rng(1).normal(size=200)
    within = (still + np.pi) % TURN - np.pi
    assert np.ptp(within) > 6.0
    assert np.ptp(within + TURN * turns(within)) < 0.01


@pytest.mark.parametrize("size", [0.1, -0.6])
def test_a_spike_leaps_twice_and_an_offset_once(t: Array, q: Array, size: float) -> None:
    spiked, shifted = q.copy(), q.copy()
    spiked[900] += size
    shifted[2500:] += size
    assert leaps(t, spiked).tolist() == [900, 901]
    assert leaps(t, shifted).tolist() == [2500]
    assert leaps(t, q).size == 0


def test_missing_samples_are_no_leap(t: Array, q: Array) -> None:
    """Whether they are told as missing, or not at all."""
    there = np.ones(len(q), dtype=bool)
    there[1000:1010] = there[2000:2400] = False
    assert leaps(t[there], q[there]).size == 0
    q[~there] = np.nan
    assert leaps(t, q).size == 0
    assert leaps(t[:9], q[:9]).size == 0


@pytest.mark.parametrize("rate", [20.0, 100.0, 1000.0])
def test_what_a_joint_does_is_no_leap(rate: float) -> None:
    """Starts and stops at 40 rad/s², coarse counts, a sensor that tells every tenth sample, and standing still."""
    t = np.arange(0.0, 10.0, 1.0 / rate)
    jerky = np.cumsum(np.cumsum(40.0 * np.sign(np.sin(2.0 * np.pi * t)) / rate)) / rate
    coarse = np.round(np.sin(t) / 0.04) * 0.04
    held = np.sin(3.0 * t)[np.arange(len(t)) // 10 * 10]
    for angle in (jerky, coarse, held, np.zeros(len(t))):
        assert leaps(t, angle).size == 0


@pytest.mark.parametrize("rate", [50.0, 1000.0])
def test_what_is_damaged_with_a_leap_is_more_than_jitter(rate: float) -> None:
    t = np.arange(1000) / rate
    for place in (0, 500, 999):
        hurt = np.flatnonzero(about(t, np.array([place])))
        assert place in hurt
        if place == 500:
            assert t[hurt[-1] + 1] - t[hurt[0] - 1] > max(0.01, 3.0 / rate)
            assert t[hurt[-1]] - t[hurt[0]] < max(0.05, 10.0 / rate)
