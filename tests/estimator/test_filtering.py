"""The filters: white stays white, derivatives are exact where they must be, both strides mean one filter."""

from __future__ import annotations

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import Trajectory
from estimator.convolution import convolve
from estimator.filtering import Decimator, motion_band, plan_filter, resample, root_raised_cosine

Array = NDArray[np.float64]


@pytest.mark.parametrize("decimation", [2, 5, 24, 50])
def test_white_noise_stays_white(decimation: int) -> None:
    noise = np.random.default_rng(decimation).normal(size=(1, 20_000 * decimation))
    rows = Decimator(decimation)(noise)[0]
    assert rows.var() * decimation == pytest.approx(1.0, abs=0.04)
    for lag in range(1, 5):
        assert abs(np.mean(rows[lag:] * rows[:-lag])) / rows.var() < 0.03


@pytest.mark.parametrize("decimation", [1, 4, 25])
def test_rest_passes_unchanged(decimation: int) -> None:
    rows = Decimator(decimation)(np.ones((2, 40 * decimation)))
    assert rows.shape == (2, 40)
    np.testing.assert_allclose(rows[:, 8:-8], 1.0, atol=1e-3)


def test_beyond_the_band_nothing_passes() -> None:
    decimation = 20
    kernel = root_raised_cosine(decimation)
    response = np.abs(np.fft.rfft(kernel, 1 << 14))
    frequency = np.fft.rfftfreq(1 << 14) * 2 * decimation  # 1 is the band
    assert response[frequency > 1.8].max() < 3e-3
    np.testing.assert_allclose(response[frequency < 0.35], 1.0, atol=0.01)


def test_coarse_and_fine_samples_give_the_same_rows() -> None:
    t = np.arange(12_000) / 1000.0
    smooth = np.sin(2 * np.pi * 1.3 * t) * np.exp(-(((t - 6.0) / 1.5) ** 2))
    fine = Decimator(48)(smooth[None])
    coarse = Decimator(12)(smooth[None, ::4])
    np.testing.assert_allclose(fine, coarse, atol=2e-6)


@pytest.mark.parametrize(("rate", "band"), [(1000.0, 10.0), (250.0, 5.0), (100.0, 20.0), (4000.0, 25.0)])
def test_kernels_differentiate_polynomials_exactly(rate: float, band: float) -> None:
    plan = plan_filter(rate, band)
    t = (np.arange(6 * plan.edge) / rate)[:, None]
    inner = slice(plan.edge, len(t) - plan.edge)
    np.testing.assert_allclose(convolve(2.0 + 3.0 * t, plan.smooth), (2.0 + 3.0 * t)[inner], atol=1e-9)
    np.testing.assert_allclose(convolve(2.0 + 3.0 * t + 5.0 * t**2, plan.slope), (3.0 + 10.0 * t)[inner], atol=1e-6)
    np.testing.assert_allclose(convolve(2.0 + 3.0 * t + 5.0 * t**2, plan.curvature), 10.0, atol=1e-4)


@pytest.mark.parametrize(("rate", "band"), [(1000.0, 10.0), (250.0, 5.0), (100.0, 20.0)])
def test_kernels_leave_the_band_alone(rate: float, band: float) -> None:
    plan = plan_filter(rate, band)
    w = 2 * np.pi * plan.band
    t = (np.arange(2000 + 2 * plan.edge) / rate)[:, None]
    inner = slice(plan.edge, len(t) - plan.edge)
    np.testing.assert_allclose(convolve(np.sin(w * t), plan.smooth), np.sin(w * t)[inner], atol=3e-3)
    np.testing.assert_allclose(convolve(np.sin(w * t), plan.slope) / w, np.cos(w * t)[inner], atol=3e-3)
    np.testing.assert_allclose(convolve(np.sin(w * t), plan.curvature) / w**2, -np.sin(w * t)[inner], atol=1e-2)


def test_rows_come_at_twice_the_band() -> None:
    plan = plan_filter(1000.0, 10.0)
    assert plan.row_rate == pytest.approx(2.0 * plan.band)
    assert plan.band == pytest.approx(10.0, rel=0.2)


def test_jittered_time_is_resampled() -> None:
    random = np.random.default_rng(4)
    t = np.cumsum(random.uniform(0.0005, 0.0015, 5000))
    channel = np.sin(2 * np.pi * t)[:, None]
    even = resample(t, channel, 1000.0)
    grid = t[0] + np.arange(len(even)) / 1000.0
    np.testing.assert_allclose(even[:, 0], np.sin(2 * np.pi * grid), atol=2e-5)


def test_even_time_is_left_as_it_is() -> None:
    channel = np.random.default_rng(1).normal(size=(100, 2))
    assert resample(np.arange(100) / 250.0, channel, 250.0) is channel


@pytest.mark.parametrize("measured", [True, False])
def test_band_of_a_motion_is_found_despite_quantisation(measured: bool) -> None:
    t = np.arange(20_000) / 1000.0
    dq = 2.0 * np.cos(2 * np.pi * 0.5 * t) + 1.0 * np.cos(2 * np.pi * 1.5 * t)
    q = np.sin(2 * np.pi * 0.5 * t) * 2.0 / np.pi + np.sin(2 * np.pi * 1.5 * t) / (3 * np.pi)
    q = np.round(q / 1e-4) * 1e-4
    trajectory = Trajectory(t, q[:, None], q[:, None], dq[:, None] if measured else None)
    assert motion_band([trajectory]) == pytest.approx(1.5, abs=0.15)


@pytest.mark.parametrize(
    ("disturbance", "band"),
    [
        ("noise that falls with frequency", 1.5),
        ("a servo that trembles", 1.5),
        ("a shaker", 15.0),
        ("a hundredth of the energy an octave above", 3.0),
    ],
)
def test_band_of_a_motion_is_that_of_what_was_meant(disturbance: str, band: float) -> None:
    """From angles alone, whose noise is not white; a line far above counts where it holds much of the energy."""
    t = np.arange(20_000) / 1000.0
    q = np.sin(2 * np.pi * 0.5 * t) * 2.0 / np.pi + np.sin(2 * np.pi * 1.5 * t) / (3 * np.pi)
    line = np.sin(2 * np.pi * 15.0 * t) / (2 * np.pi * 15.0)
    q += {
        "noise that falls with frequency": np.cumsum(1e-3 * np.random.default_rng(2).normal(size=len(t))),
        "a servo that trembles": 0.2 * line,
        "a shaker": 0.5 * line,
        "a hundredth of the energy an octave above": 0.25 * np.sin(2 * np.pi * 3.0 * t) / (2 * np.pi * 3.0),
    }[disturbance]
    assert motion_band([Trajectory(t, q[:, None], q[:, None])]) == pytest.approx(band, rel=0.1)


def creeping(t: Array, line_hz: float) -> Trajectory:
    """A slow sweep, to and fro, while the servo trembles as fast as the joint moves."""
    slow, fast = (0.02 * np.sin(2 * np.pi * hz * t) / (2 * np.pi * hz) for hz in (0.2, line_hz))
    q = slow + fast
    return Trajectory(t, q[:, None], q[:, None])


def moving(t: Array, speed: float) -> Trajectory:
    q = speed * np.sin(2 * np.pi * 1.5 * t) / (2 * np.pi * 1.5)
    return Trajectory(t, q[:, None], q[:, None])


def test_what_lies_above_any_motion_is_none() -> None:
    t = np.arange(20_000) / 1000.0
    assert motion_band([creeping(t, 175.0)]) == pytest.approx(0.2, abs=0.06)
    assert motion_band([creeping(t, 40.0)]) == pytest.approx(40.0, abs=0.1)


@pytest.mark.parametrize(("speed", "band"), [(2.0, 1.5), (0.2, 15.0)])
def test_a_recording_that_creeps_beside_others_that_move_does_not_widen_the_band(speed: float, band: float) -> None:
    t = np.arange(20_000) / 1000.0
    assert motion_band([creeping(t, 15.0), moving(t, speed)]) == pytest.approx(band, abs=0.1)
    joints = np.hstack([creeping(t, 15.0).q, moving(t, speed).q])
    assert motion_band([Trajectory(t, joints, joints)]) == pytest.approx(band, abs=0.1)
