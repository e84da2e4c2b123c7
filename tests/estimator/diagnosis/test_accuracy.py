"""Links that recordings bear out better than their tolerance, and what is seen then."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from config import load_installation
from estimator import RigidBody, Trajectory, inverse_dynamics, load_rigid_body
from estimator.base_parameters import base_parameters
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.naming.accuracy import nats_by_chance
from estimator.diagnosis.observed.tolerance import base_precision
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]
Diagnoser = Callable[..., Diagnosis]

NOISE = np.array([0.9, 1.2, 0.7, 0.3, 0.15, 0.1])
"""N·m, white."""
LOAD = 0.04
"""kg at the flange's centre."""


@pytest.fixture(scope="module")
def diagnosed(six_axis: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]) -> Diagnoser:
    """Two playings of three motions of an arm whose links' masses and inertias are off by a scatter."""

    def make(scatter: float, seed: int, payload: float = 0.0, heavier: dict[int, float] | None = None) -> Diagnosis:
        random = np.random.default_rng(seed)
        true = six_axis.prior() * (1.0 + scatter * np.repeat(random.normal(size=six_axis.n), 10))
        true[-10] += payload
        for link, share in (heavier or {}).items():
            true[10 * link : 10 * link + 10] += share * six_axis.prior()[10 * link : 10 * link + 10]
        recordings = []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(six_axis.n, 8.0, 250.0, 10 * seed + motion)
            tau = inverse_dynamics(six_axis, true, q, dq, ddq)
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + NOISE * random.normal(size=q.shape)))
        return diagnose(six_axis, recordings)

    return make


def borne_out(found: Diagnosis) -> bool:
    return any("the links fit these recordings" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_exact_links_show_what_their_tolerance_would_take(diagnosed: Diagnoser, seed: int) -> None:
    """A load of a few hundredths of the last link, which could be that link's own error."""
    found = diagnosed(0.0, seed, payload=LOAD)
    (first,) = found.findings
    assert first.effect in ("payload", "link_inertia")
    mass = first.parameters["mass"]
    assert abs(float(mass.value) - LOAD) < 4.0 * float(mass.standard_error)
    assert borne_out(found)


@pytest.mark.parametrize("seed", range(3))
def test_links_that_are_off_within_their_tolerance_hide_it(diagnosed: Diagnoser, seed: int) -> None:
    """They could be what is off, and it is not said that they are not."""
    assert diagnosed(0.04, seed, payload=LOAD).verdict == "clean"


@pytest.mark.parametrize("scatter", [0.0, 0.002, 0.01, 0.05])
@pytest.mark.parametrize("seed", range(3))
def test_no_scatter_of_the_links_is_a_cause(diagnosed: Diagnoser, scatter: float, seed: int) -> None:
    found = diagnosed(scatter, seed)
    assert found.verdict == "clean", found.findings
    assert borne_out(found) or scatter > 0.01


@pytest.mark.parametrize(("scatter", "share"), [(0.02, 0.45), (0.0, 0.25)])
@pytest.mark.parametrize("link", [1, 2])
def test_a_link_that_is_heavier_by_far_is_named(
    six_axis: RigidBody, diagnosed: Diagnoser, scatter: float, share: float, link: int
) -> None:
    """With one unknown, its density, where ten would take more to be believed than the tolerance costs."""
    found = diagnosed(scatter, 0, heavier={link: share})
    (only,) = found.findings
    assert (only.effect, only.place.joint, only.status) == ("link_inertia", link, "named")
    mass = only.parameters["m"]
    assert abs(float(mass.value) / (share * six_axis.prior()[10 * link]) - 1.0) < 0.25


@pytest.mark.parametrize("link", [1, 2])
def test_a_link_that_is_heavier_within_its_tolerance_is_no_cause(diagnosed: Diagnoser, link: int) -> None:
    """Even if all others are exact."""
    assert diagnosed(0.0, 0, heavier={link: 0.06}).verdict == "clean"


def test_a_link_of_more_unknowns_gains_more_by_chance() -> None:
    """Half a chi-square: its table has 16 for four standard deviations of one unknown, and 36.8 for ten at 6.3e-5."""
    assert nats_by_chance(1, 1) == pytest.approx(8.0)
    assert nats_by_chance(10, 1) == pytest.approx(18.4, abs=0.05)
    assert nats_by_chance(10, 6) > nats_by_chance(10, 1) + 2.0
    rng = np.random.default_rng(5)
    worst = 0.5 * (rng.normal(size=(20_000, 6, 10)) ** 2).sum(axis=2).max(axis=1)
    assert np.count_nonzero(worst > nats_by_chance(10, 6)) <= 6 < np.count_nonzero(worst > nats_by_chance(10, 6) - 4.0)


def test_exact_links_leave_less_unseen(diagnosed: Diagnoser) -> None:
    exact, scattered = (diagnosed(scatter, 0).smallest_detectable["torque_constant_error"] for scatter in (0.0, 0.05))
    assert all(exact[joint] < 0.8 * scattered[joint] for joint in range(6))


def by_numbers(body: RigidBody, share: float, random: np.random.Generator) -> Array:
    """The body's parameters, each number that a URDF has of a link off by up to a share of it."""
    result = []
    for parameters in body.prior().reshape(-1, 10):
        mass, centre = parameters[0], parameters[1:4] / parameters[0]
        upper = np.triu_indices(3)
        about = np.zeros((3, 3))
        about[upper] = parameters[4:]
        about = about + np.triu(about, 1).T - mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))
        mass = mass * (1.0 + share * random.uniform(-1.0, 1.0))
        centre = centre * (1.0 + share * random.uniform(-1.0, 1.0, 3))
        inertia = about[upper] * (1.0 + share * random.uniform(-1.0, 1.0, 6))
        inertia = inertia + mass * (centre @ centre * np.eye(3) - np.outer(centre, centre))[upper]
        result.append(np.concatenate([[mass], mass * centre, inertia]))
    return np.concatenate(result)


@pytest.mark.parametrize("arm", ["dda", "puma600", "seven"])
def test_a_urdf_whose_numbers_are_off_is_within_the_tolerance_of_them(arm: str) -> None:
    """Long links and thin ones too: no deviation is farther than chance takes it, so that none is a cause."""
    installation = load_installation(arm)
    body = load_rigid_body((installation.path.parent / installation.arm.urdf).read_text(), installation.joint_names)
    base = base_parameters(body)
    precision = base_precision(body, base, 0.05)
    random = np.random.default_rng(0)
    for _ in range(20):
        off = base.combination @ (by_numbers(body, 0.05, random) - body.prior())
        assert off @ precision @ off < 2.0 * base.rank
        directions, vectors = np.linalg.eigh(precision)
        assert np.max(np.abs(np.sqrt(directions) * (vectors.T @ off))) < 4.5


@pytest.fixture(scope="module")
def late(six_axis: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]) -> Diagnoser:
    """Drives whose torques are each late by a time of its own (s), sampled at 500 Hz."""

    def make(skew: Array, seed: int = 1) -> Diagnosis:
        random = np.random.default_rng(seed)
        true = six_axis.prior() * (1.0 + 0.02 * np.repeat(random.normal(size=six_axis.n), 10))
        recordings = []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(six_axis.n, 8.0, 500.0, 10 * seed + motion)
            on_time = inverse_dynamics(six_axis, true, q, dq, ddq)
            tau = np.array([np.interp(t - s, t, column) for s, column in zip(skew, on_time.T, strict=True)]).T
            for _ in range(2):
                measured = q + 1e-6 * random.normal(size=q.shape)
                recordings.append(Trajectory(t, measured, tau + 0.2 * NOISE * random.normal(size=q.shape)))
        return diagnose(six_axis, recordings)

    return make


def test_one_drive_that_is_late_among_punctual_ones_is_named(late: Diagnoser) -> None:
    """By half a sample, as much as any channel may be off at first."""
    found = late(np.array([0.0, 0.0, 1e-3, 0.0, 0.0, 0.0]))
    (only,) = found.findings
    assert (only.effect, only.place.joint, only.place.channel) == ("transport_delay", 2, "torque")
    delay = only.parameters["delay"]
    assert abs(float(delay.value) - 1e-3) < 4.0 * float(delay.standard_error)
    assert any("in time to a small part of a sample" in note for note in found.notes)


@pytest.mark.parametrize("step", [1e-4, 2e-4])
def test_drives_that_report_in_turn_are_none_of_them_late(late: Diagnoser, step: float) -> None:
    """A bus carries one frame after the other; on the average they are in time."""
    assert late(step * (np.arange(6) - 2.5)).verdict == "clean"
