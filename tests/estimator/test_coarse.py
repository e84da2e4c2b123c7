"""Fast recordings are looked at by means of successive samples, without smearing what is missing."""

from __future__ import annotations

import numpy as np

from estimator import Trajectory
from estimator.plausibility.coarse import coarse


def fast(rate: float) -> Trajectory:
    t = np.arange(0.0, 2.0, 1.0 / rate)
    q = np.sin(2.0 * np.pi * t)[:, None]
    dq = 2.0 * np.pi * np.cos(2.0 * np.pi * t)[:, None]
    return Trajectory(t, q, 3.0 * q, dq, unusable=q > 0.9, temperature=20.0 + t[:, None])


def test_what_is_slow_is_left_as_it_is() -> None:
    slow = fast(400.0)
    assert coarse(slow) is slow


def test_means_of_a_fast_recording() -> None:
    thinned = coarse(fast(10e3))
    assert 240.0 < thinned.rate < 260.0
    assert np.abs(thinned.q[:, 0] - np.sin(2.0 * np.pi * thinned.t)).max() < 1e-3
    assert np.allclose(thinned.tau, 3.0 * thinned.q)
    assert thinned.unusable is not None
    assert thinned.unusable[thinned.q > 0.91].all()
    assert thinned.temperature is not None
    assert np.allclose(thinned.temperature[:, 0], 20.0 + thinned.t)


def test_a_block_with_a_gap_or_a_missing_sample_is_missing() -> None:
    whole = fast(10e3)
    whole.tau[5000] = np.nan
    late = np.where(np.arange(whole.samples) > 9010, 0.1, 0.0)
    thinned = coarse(Trajectory(whole.t + late, whole.q, whole.tau))
    assert np.flatnonzero(np.isnan(thinned.tau[:, 0])).tolist() == [125]
    assert np.flatnonzero(np.isnan(thinned.q[:, 0])).tolist() == [225]
