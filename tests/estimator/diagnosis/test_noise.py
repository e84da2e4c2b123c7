"""What makes noise white, and the noise that is assumed where no motion was played again."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimator import RigidBody, Trajectory
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.observed.assumed_noise import assumed_noise
from estimator.diagnosis.observed.noise import (
    ASSUMED_ORDER,
    ORDER,
    WIDENED,
    Noise,
    autocovariance,
    autoregressive,
    density_of,
    with_density,
)
from estimator.diagnosis.observed.repetition import Laid, playings, repeated_noise
from estimator.diagnosis.observed.stretches import Channel, Grid
from estimator.repeats import Occurrence, RepeatGroup

ROWS = 480


def slow_columns(random: np.random.Generator) -> NDArray[np.float64]:
    """(90, rows) of frequencies below a quarter of the rows' highest, where 120 directions are all that there are."""
    spectrum = np.fft.rfft(random.normal(size=(90, ROWS)), axis=1)
    spectrum[:, ROWS // 8 :] = 0.0
    return np.asarray(np.fft.irfft(spectrum, ROWS, axis=1))


def below(power: NDArray[np.float64], share: float) -> float:
    """Mean power of whitened rows (draws, rows) below a share of their highest frequency."""
    spectra = np.abs(np.fft.rfft(power, axis=1)[:, 1:]) ** 2 / power.shape[1]
    return float(spectra[:, : int(share * spectra.shape[1])].mean())


def test_columns_that_say_the_same_but_for_rounding_swallow_no_noise() -> None:
    """Directions that only rounding has would take noise away by chance, another share on every processor."""
    random = np.random.default_rng(0)
    columns, residual = random.normal(size=(20, 600)), random.normal(size=(1, 600))
    mixed = random.normal(size=(150, 20)) @ columns
    unseen = np.zeros((1, ORDER + 1))
    alone, doubled = (
        assumed_noise([[np.vstack([*rows, residual])]], unseen)[0]
        for rows in ([columns], [columns, mixed, 3.0 * columns])
    )
    assert doubled.rms == pytest.approx(alone.rms, rel=1e-9)
    assert doubled.filters == pytest.approx(alone.filters, rel=1e-6, abs=1e-9)


@pytest.mark.parametrize("pole", [0.0, 0.8])
def test_noise_that_the_columns_swallow_is_told_by_what_they_leave(pole: float) -> None:
    """A model of slow columns leaves a hole in the noise's spectrum, just where causes are; in whitened rows the noise
    must not stand out there."""
    random = np.random.default_rng(3)
    columns = slow_columns(random)
    noise = lfilter([np.sqrt(1.0 - pole**2)], [1.0, -pole], random.normal(size=(40, ROWS + 200)), axis=1)[:, 200:]
    whitened = [
        assumed_noise([[np.vstack([columns, own])]], np.zeros((1, ORDER + 1)))[0].whiten(0, own[None])[0]
        for own in noise
    ]
    assert below(np.array(whitened), 1.0) == pytest.approx(1.0 / WIDENED**2, rel=0.15)
    assert below(np.array(whitened), 0.2) < 1.0
    kept = np.linalg.svd(columns, full_matrices=False)[2]
    left = noise - noise @ kept.T @ kept
    assert below(left, 0.2) < 0.3 * below(noise, 0.2), "as it is, the hole would be taken for the noise's colour"


def test_a_model_without_columns_leaves_all_noise() -> None:
    noise = np.random.default_rng(1).normal(size=(1, 4000))
    found, _ = assumed_noise([[noise]], np.zeros((1, ORDER + 1)))
    assert isinstance(found, Noise)
    assert found.rms[0] == pytest.approx(WIDENED, rel=0.05)
    # What a filter looks back at is lost to short recordings.
    assert found.whiten(0, noise).shape == (1, 4000 - ASSUMED_ORDER)
    assert not found.filters[:, ASSUMED_ORDER + 1 :].any()


@pytest.mark.parametrize(("frequency", "least"), [(0.05, 0.8), (0.1, 0.8), (0.3, 0.8)])
def test_slow_causes_are_told_beside_the_noise_of_accelerations(frequency: float, least: float) -> None:
    """Angles' white errors are noise of accelerations, by the fourth power of the frequency (cycles a row): of what the
    slow rows tell, a filter that makes it white keeps most, and not much more than all."""
    random = np.random.default_rng(0)
    rows = np.diff(random.normal(size=4002), 2) + 0.02 * random.normal(size=4000)
    taps = autoregressive(autocovariance([rows[:, None]])[0], len(rows))
    phase = np.exp(-2j * np.pi * frequency * np.arange(ORDER + 1))
    density = (2.0 * np.sin(np.pi * frequency)) ** 4 + 0.02**2
    assert least < density * abs(taps @ phase) ** 2 < 1.5


def test_a_density_has_its_autocovariance() -> None:
    density = np.array([3.0, 2.0, 1.0, 0.5])
    covariance = with_density(density)
    assert covariance[0] == pytest.approx(density.mean())
    frequency = np.pi * (np.arange(40_000) + 0.5) / 40_000
    waves = np.cos(np.outer(np.arange(ORDER + 1), frequency))
    np.testing.assert_allclose(covariance, (waves * np.repeat(density, 10_000)).mean(axis=1), atol=1e-6)
    np.testing.assert_allclose(density_of(with_density(np.full((2, 6), 0.7)), 6), 0.7)
    falling = density_of(covariance, 4)
    assert np.all(np.diff(falling) < 0.0)
    np.testing.assert_allclose(falling, density, rtol=0.25)


@pytest.mark.parametrize(("there", "least", "most"), [(0.0, 0.9, 1.1), (1.0, 1.8, 2.1), (4.0, 1.9, 2.1)])
def test_errors_that_recur_are_no_more_than_what_recurs(there: float, least: float, most: float) -> None:
    """Playings with a noise of variance one each, of which as much again is said to recur: there is that, none of it,
    or more, which is no error."""
    random = np.random.default_rng(2)
    normal = random.normal
    stacks = [np.sqrt(there) * normal(size=(1, 1, 300, 1)) + normal(size=(1, 3, 300, 1)) for _ in range(6)]
    unseen = np.zeros((1, ORDER + 1))
    unseen[0, 0] = 1.0
    noise = repeated_noise(stacks, unseen, np.zeros_like(unseen))
    assert noise is not None
    assert least < noise.rms[0] ** 2 < most


def test_a_cause_that_recurs_at_low_frequencies_hides_no_errors_above() -> None:
    random = np.random.default_rng(3)
    wave = 5.0 * np.sin(2.0 * np.pi * 0.01 * np.arange(600))[None, None, :, None]
    unseen = np.zeros((1, ORDER + 1))
    unseen[0, 0] = 1.0
    stacks = [wave + random.normal(size=(1, 2, 600, 1)) for _ in range(4)]
    noise = repeated_noise(stacks, unseen, np.zeros_like(unseen))
    assert noise is not None
    assert 1.0 < noise.rms[0] ** 2 < 1.35, "a twelfth of the frequencies holds the cause"


@pytest.mark.parametrize(("resting", "most"), [(150, 1.1), (290, np.inf)])
def test_rests_in_which_a_joint_is_held_otherwise_are_no_noise(resting: int, most: float) -> None:
    """By three standard deviations more in one playing, and by as many less in the other. Where little but rests is
    left, they are all that tells the noise."""
    random, stands = np.random.default_rng(4), np.zeros((1, 2, 300, 2))
    stands[:, :, :resting, 1] = 1.0
    held = 3.0 * stands * np.array([1.0, -1.0])[None, :, None, None]
    stacks = [held + random.normal(size=(1, 2, 300, 2)) for _ in range(4)]
    nothing = np.zeros((2, ORDER + 1))
    plain, parted = (repeated_noise(stacks, nothing, nothing, None, rests) for rests in (None, [stands] * 4))
    assert plain is not None
    assert parted is not None
    assert plain.rms[1] ** 2 > 4.0
    assert parted.rms[0] == plain.rms[0]
    assert 0.9 < parted.rms[1] ** 2 < most
    if np.isinf(most):
        assert parted.rms[1] == plain.rms[1]


def test_a_noise_at_half_the_rate_of_the_rows_is_seen_wherever_they_begin() -> None:
    """A wave of half the rows' rate is as large in rows that begin anywhere: some see its crests, some its zeros."""
    grid = Grid(10.0, (Channel("torque", 0),), np.zeros(1), 5.0)
    period = 0.014
    decimation = grid.decimation(period)
    half = 0.5 / (period * decimation)
    t = period * np.arange(700)
    occurrences = tuple(Occurrence(k, 1.0) for k in range(2))
    group = RepeatGroup(occurrences, 7.0, np.zeros(1))
    sizes = []
    for phase in np.linspace(0.0, np.pi, 7):
        wave = np.sin(2.0 * np.pi * half * t + phase)[:, None]
        (stack,) = playings([group], grid, Laid([t, t], [wave, np.zeros_like(wave)]))
        sizes.append(float(np.mean((stack[:, 0, 12:-12] - stack[:, 1, 12:-12]) ** 2)))
    np.testing.assert_allclose(sizes, np.mean(sizes), rtol=0.02)


def test_a_friction_that_recurs_is_no_error_that_recurs(
    make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]
) -> None:
    """Errors of counted angles are believed to be no larger for a friction of many times their size beside them."""
    body, count = make_chain("rr"), 2e-4

    def noise(friction: float) -> NDArray[np.float64]:
        law = friction * np.array([1.0, 0.2])
        played = play_twice(body, lambda q, dq: law * (np.tanh(dq / 0.01) + dq), noise=0.02)
        return gather(body, [replace(one, q=np.round(one.q / count) * count) for one in played], 0.02).noise.rms

    assert np.all(noise(1.5) < 2.0 * noise(0.0)), "what the law leaves where the joints turn is a part of it"
