"""Intervals of a few rows whose noise's spectrum is told by the same rows."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter
from scipy.stats import t as student

from estimator.loads.fit import LoadFit, fit_load
from estimator.loads.layout import LoadLayout
from estimator.loads.unsure_noise import with_unsure_noise
from estimator.sums import Sums

ROWS, RUNS, TRUE = 50, 120, 2.0
LAYOUT = LoadLayout(channels=(0,), kinds=("offset",), labels=("force",), common=1)


def seen(seed: int, rows: int, fades: float = 0.6) -> Sums:
    """One unknown's slow swing and an offset, in slow noise and white noise of about the same power."""
    random = np.random.default_rng([17, seed])
    slow = lfilter([np.sqrt(1.0 - fades**2)], [1.0, -fades], random.normal(size=rows + 50))[50:]
    column = np.sin(2.0 * np.pi * np.arange(rows) / rows)
    sums = Sums()
    sums.add([np.vstack([column, np.ones(rows), TRUE * column + 0.7 + slow + random.normal(size=rows)])], 0)
    return sums


def holds(fit: LoadFit) -> bool:
    reach = student.isf(0.025, fit.degrees_of_freedom) * np.sqrt(fit.covariance[0, 0])
    return bool(abs(fit.value[0] - TRUE) < reach)


def test_intervals_hold_where_those_of_one_spectrum_do_not() -> None:
    one, all_of_them = [], []
    for seed in range(RUNS):
        sums = seen(seed, ROWS)
        fit = fit_load(LAYOUT, sums)
        one.append(holds(fit))
        all_of_them.append(holds(with_unsure_noise(LAYOUT, sums, [], fit)))
    assert np.mean(one) < 0.93 <= np.mean(all_of_them) <= 0.98


def test_long_recordings_leave_nothing_open() -> None:
    sums = seen(0, 20_000)
    fit = fit_load(LAYOUT, sums)
    open_still = with_unsure_noise(LAYOUT, sums, [], fit)
    np.testing.assert_allclose(open_still.covariance, fit.covariance, rtol=0.15)
    np.testing.assert_allclose(open_still.value, fit.value, atol=0.1 * np.sqrt(fit.covariance[0, 0]))
    assert open_still.degrees_of_freedom > 100.0
