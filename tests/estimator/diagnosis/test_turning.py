"""Torques are less sure where a joint turns: by how much, how far, and where not at all."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.observed.noise import ORDER, Noise
from estimator.diagnosis.observed.turning import factor, most_likely, near_turns, settled
from estimator.filtering import Decimator

Array = NDArray[np.float64]

SAMPLES, STEP = 1200, 4
TAPS = np.append([1.0, -0.7, 0.2], np.zeros(ORDER - 2))
"""Of a whitening filter."""
NOISE = 0.02
"""N·m, white."""


@pytest.fixture(scope="module")
def noise() -> Noise:
    return Noise(TAPS[None], np.ones(1), 100.0, 4, np.ones(1))


@pytest.fixture(scope="module")
def angle() -> Array:
    """rad, of a joint that turns a dozen times."""
    t = np.arange(SAMPLES) / 100.0
    return np.asarray(np.sin(3.0 * t) + 0.3 * np.sin(5.3 * t))


def test_a_reversal_fades_with_the_way_from_it() -> None:
    up, down = np.linspace(0.0, 1.0, 101), np.linspace(1.0, 0.2, 81)
    near = near_turns(np.concatenate([up, down[1:]]), 0.1)
    assert near[100] == 1.0
    np.testing.assert_allclose(near[[90, 110]], np.exp(-1.0))
    np.testing.assert_allclose(near[0], np.exp(-10.0))


@pytest.mark.parametrize("q", [np.zeros(50), np.linspace(0.0, 3.0, 50)], ids=["stands", "goes one way"])
def test_what_does_not_turn_is_sure(q: Array) -> None:
    assert not near_turns(q, 0.1).any()


def test_errors_of_samples_come_out_in_rows_as_they_were_spread(noise: Noise, angle: Array) -> None:
    """Against the rows of each sample's error by itself."""
    variance = near_turns(angle, 0.05)
    rows = SAMPLES // STEP - noise.past
    banded = noise.spread(0, STEP).covariance(variance, rows)
    each = noise.whiten(0, Decimator(STEP)(np.diag(np.sqrt(variance))))
    whole = each.T @ each
    lags = len(banded)
    inner = slice(lags, rows - lags)
    for lag, own in enumerate(banded):
        np.testing.assert_allclose(own[inner], np.diag(whole, -lag)[inner], atol=1e-6)
    assert not np.tril(whole, -lags)[inner, inner].any()


def test_rows_come_out_white(noise: Noise, angle: Array) -> None:
    rows = SAMPLES // STEP - noise.past
    banded = 9.0 * noise.spread(0, STEP).covariance(near_turns(angle, 0.05), rows)
    factored = factor(banded)
    coloured = np.zeros((rows, rows))
    for lag, own in enumerate(factored):
        coloured += np.diag(own[: rows - lag], -lag)
    np.testing.assert_allclose(settled(factored, coloured.T), np.eye(rows), atol=1e-9)
    np.testing.assert_array_equal(settled(None, coloured), coloured)


@pytest.mark.parametrize("error", [0.0, 4.0])
def test_the_errors_of_reversals_are_as_large_as_they_are(noise: Noise, angle: Array, error: float) -> None:
    random, span = np.random.default_rng(0), float(np.ptp(angle))
    spread, residuals = noise.spread(0, STEP), []
    for _ in range(4):
        turns = error * near_turns(angle, 1e-3 * span) * random.normal(size=SAMPLES)
        rows = noise.whiten(0, Decimator(STEP)(turns[None]))[0]
        residuals.append(rows + random.normal(size=len(rows)))
    found, _ = most_likely(residuals, [angle] * 4, [spread] * 4, 8.0, span)
    assert found == pytest.approx(error, rel=0.3)


@pytest.mark.parametrize("friction", ["none", "rising"])
def test_what_a_law_tells_is_no_error_of_reversals(
    make_chain: Callable[..., RigidBody],
    make_periodic: Callable[..., tuple[Array, Array, Array, Array]],
    friction: str,
) -> None:
    """Nor a rise from rest beside a friction of six times the noise, which acts about each of them."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in (0, 0, 1, 1):
        t, q, dq, ddq = make_periodic(2, 8.0, 250.0, motion)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + NOISE * random.normal(size=q.shape)
        if friction == "rising":
            rise = 0.4 * np.exp(-np.square(dq[:, 1] / (0.2 * dq[:, 1].std())))
            tau[:, 1] += 6.0 * NOISE * (1.0 + rise) * np.sign(dq[:, 1])
        recordings.append(Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau))
    assert not gather(body, recordings, 0.05).noise.turning


def between_rests(body: RigidBody, held: float, playings: int) -> list[Trajectory]:
    """A joint that goes forth and back between rests, in each of which its friction of 1 N·m has the same part of its
    level, as a servo leaves it there in every playing."""
    random, recordings = np.random.default_rng(4), []
    t = np.arange(500) / 250.0
    moves = t < 1.2
    s = np.where(moves, t / 1.2, 1.0)
    way, speed, rise = (
        10 * s**3 - 15 * s**4 + 6 * s**5,
        30 * s**2 - 60 * s**3 + 30 * s**4,
        60 * s - 180 * s**2 + 120 * s**3,
    )
    for stroke in (0.6, 1.0, 1.4):
        q, dq, ddq = [], [], []
        for begin, sign in ((0.0, 1.0), (1.0, -1.0)) * 2:
            a = stroke * np.array([1.0, -0.7])
            q.append(a * (begin + sign * way[:, None]))
            dq.append(a * sign * speed[:, None] / 1.2)
            ddq.append(a * sign * rise[:, None] / 1.44)
        angle, rate, pull = (np.concatenate(x) for x in (q, dq, ddq))
        tau = inverse_dynamics(body, body.prior(), angle, rate, pull)
        stands = np.tile(~moves, 4)
        tau[:, 0] += np.where(stands, held, np.sign(rate[:, 0]))
        for _ in range(playings):
            measured = angle + 1e-6 * random.normal(size=angle.shape)
            recordings.append(
                Trajectory(np.arange(len(angle)) / 250.0, measured, tau + 0.2 * random.normal(size=tau.shape))
            )
    return recordings


@pytest.mark.parametrize("held", [0.6, -0.5])
def test_what_friction_holds_a_standing_joint_by_is_no_evidence_of_an_offset(
    make_chain: Callable[..., RigidBody], held: float
) -> None:
    body = make_chain("rr")
    found = diagnose(body, between_rests(body, held, 2))
    assert [(f.effect, f.place.joint, f.status) for f in found.findings] == [("coulomb_friction", 0, "named")]
    assert found.unexplained == {}
    level = found.findings[0].parameters["level"]
    assert abs(float(level.value) - 1.0) < 3.0 * float(level.standard_error)


def test_a_rest_says_no_more_for_being_played_again(make_chain: Callable[..., RigidBody]) -> None:
    body = make_chain("rr")
    two, eight = (gather(body, between_rests(body, 0.6, n), 0.05).noise.turning[0].held for n in (2, 8))
    assert eight == pytest.approx(2.0 * two, rel=0.1)


def test_a_joint_that_is_held_otherwise_in_each_playing_has_no_more_noise(make_chain: Callable[..., RigidBody]) -> None:
    """As one that creeps from where it began: what friction holds it by is many times the noise, and is not noise."""
    body = make_chain("rr")
    noise = {}
    for other in (0.9, -0.9):
        recordings = [*between_rests(body, 0.9, 2)[::2], *between_rests(body, other, 2)[1::2]]
        noise[other] = gather(body, recordings, 0.05).noise.likely
    assert np.all(noise[-0.9] < 1.1 * noise[0.9])
