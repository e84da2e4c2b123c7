"""A wider law stands beside those that it contains where chance would not explain so much more."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.base_parameters import base_parameters
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Candidate, Design
from estimator.diagnosis.evidence.grams import Block
from estimator.diagnosis.evidence.typical import against_typical
from estimator.diagnosis.evidence.weighted import Weighted
from estimator.diagnosis.naming.rivals import AMBIGUOUS
from estimator.diagnosis.observed.stretches import Channel
from estimator.effects import catalogue

Array = NDArray[np.float64]


Periodic = Callable[..., tuple[Array, Array, Array, Array]]


def played(
    body: RigidBody,
    make_periodic: Periodic,
    torque: Callable[[Array, Array, Array], Array],
    *,
    motions: int = 3,
    seconds: float = 5.0,
    playings: int = 2,
    noise: float = 0.6,
    reach: float = 1.0,
    seed: int = 0,
) -> list[Trajectory]:
    """Recordings of two joints, the second with a torque of t, q and dq beside the model's; ``reach``: of the usual
    way."""
    random, recordings = np.random.default_rng(seed), []
    for motion in range(motions):
        t, *path = make_periodic(2, seconds, 200.0, 10 * seed + motion)
        q, dq, ddq = (reach * x for x in path)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        tau[:, 1] += torque(t, q[:, 1], dq[:, 1])
        for _ in range(playings):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + noise * random.normal(size=q.shape)))
    return recordings


@pytest.mark.parametrize(("more_forwards", "status"), [(0.0, "named"), (0.018, "ambiguous")])
def test_friction_that_is_hardly_other_forwards_may_be_either(
    make_chain: Callable[..., RigidBody],
    make_periodic: Periodic,
    more_forwards: float,
    status: str,
) -> None:
    body, random, recordings = make_chain("rr"), np.random.default_rng(0), []
    for motion in range(3):
        t, q, dq, ddq = make_periodic(2, 5.0, 200.0, motion)
        friction = 0.8 * np.sign(dq) + 0.5 * dq
        friction[:, 1] += more_forwards * np.maximum(dq[:, 1], 0.0)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + friction
        for _ in range(2):
            measured = q + 1e-6 * random.normal(size=q.shape)
            recordings.append(Trajectory(t, measured, tau + 0.6 * random.normal(size=q.shape)))
    found = [f for f in diagnose(body, recordings).findings if f.place.joint == 1]
    assert {(f.effect, f.status) for f in found} == {("coulomb_friction", status), ("viscous_friction", status)}
    if status == "ambiguous":
        assert all([a.effect for a in f.alternatives] == ["asymmetric_friction"] for f in found)


Record = Callable[[RigidBody, Callable[[Array], Array], float, int], list[Trajectory]]


@pytest.fixture
def record(make_periodic: Periodic) -> Record:
    """Recordings with a torque that goes with the second joint's angle."""

    def make(body: RigidBody, law: Callable[[Array], Array], reach: float, seed: int) -> list[Trajectory]:
        return played(body, make_periodic, lambda t, q, dq: law(q), reach=reach, seed=seed)

    return make


def test_a_spring_stands_beside_an_offset_unless_its_usual_stiffness_would_show(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """A spring whose centre is a radian away, of which a tenth of a radian shows little more than the offset; and an
    offset, over a way along which such a spring would be seen."""
    body = make_chain("rr")
    spring = played(body, make_periodic, lambda t, q, dq: 0.15 * (1.0 + q), reach=0.1, seed=1)
    offset = played(body, make_periodic, lambda t, q, dq: 0.8 * np.ones_like(q), reach=0.4, seed=1)
    (found,) = diagnose(body, spring, tolerance=0.005).findings
    assert (found.effect, found.status) == ("torque_offset", "ambiguous")
    assert "joint_spring" in [a.effect for a in found.alternatives]
    (found,) = diagnose(body, offset).findings
    assert (found.effect, found.status) == ("torque_offset", "named")
    assert next(a.log_likelihood_gap for a in found.rivals if a.effect == "joint_spring") > 10.0


@pytest.mark.parametrize(("reach", "first", "second"), [(0.4, 2.5, 4.3), (0.25, 3.0, 5.2), (0.4, 1.7, 2.9)])
def test_a_spring_beside_a_slow_cogging_may_be_its_form(
    make_chain: Callable[..., RigidBody], record: Record, reach: float, first: float, second: float
) -> None:
    """Two pulleys out of round, over less than two turns of the faster."""

    def pulleys(q: Array) -> Array:
        return np.sin(first * q + 0.4) + np.sin(second * q + 1.9)

    body = make_chain("rr")
    found = {f.effect: f for f in diagnose(body, record(body, pulleys, reach, 0)).findings}
    assert "cogging" in found
    assert set(found) <= {"cogging", "joint_spring"}
    if "joint_spring" in found:
        assert found["joint_spring"].status == "ambiguous"
        assert [a.effect for a in found["joint_spring"].alternatives] == ["cogging"]


def test_two_slow_lines_stay_what_they_are(make_chain: Callable[..., RigidBody], record: Record) -> None:
    """At the shapes that suit them best, also where a spring in the place of either was sought beside the other."""
    body = make_chain("rr")
    found = diagnose(body, record(body, lambda q: np.sin(2.9 * q + 1.0) + np.sin(4.9 * q - 1.0), 0.65, 0)).findings
    assert {(f.effect, f.status) for f in found} == {("cogging", "named")}
    orders = sorted(float(f.parameters["order"].value) for f in found)
    np.testing.assert_allclose(orders, [2.9, 4.9], atol=0.3)


def strut(q: Array) -> Array:
    """N·m of a cylinder of constant force between two points, 0.14 m and 0.1 m from the axis, in line at 0.8 rad."""
    x = q - 0.8
    return 60.0 * 0.014 * np.sin(x) / np.sqrt(0.0296 - 0.028 * np.cos(x))


def hose(q: Array) -> Array:
    """N·m of a hose that is pulled tight."""
    return np.asarray(0.3 * (q + 0.2) + 0.6 * (q + 0.2) ** 3)


@pytest.mark.parametrize(("law", "way"), [(strut, 1.0), (hose, -1.0)])
def test_a_spring_that_bends_is_a_spring(
    make_chain: Callable[..., RigidBody], record: Record, law: Callable[[Array], Array], way: float
) -> None:
    """Of other forms than the catalogue's; a slow cogging, at the order that suits it best, is behind."""
    body = make_chain("rr")
    recordings = record(body, law, 0.5, 3)
    (finding,) = diagnose(body, recordings).findings
    assert (finding.effect, finding.place.joint, finding.status) == ("joint_spring", 1, "named")
    assert way * float(finding.parameters["bend"].value) > 0.0
    assert "cogging" in [a.effect for a in finding.rivals]


def test_a_spring_beside_a_cogging_of_many_teeth_is_one(make_chain: Callable[..., RigidBody], record: Record) -> None:
    body = make_chain("rr")
    found = diagnose(body, record(body, lambda q: np.sin(24.0 * q) + 2.0 * q, 0.4, 0)).findings
    assert {(f.effect, f.place.joint, f.status) for f in found} == {
        ("joint_spring", 1, "named"),
        ("cogging", 1, "named"),
    }


@pytest.mark.parametrize("seed", range(6))
def test_an_offset_is_no_spring_for_what_chance_would_explain(
    make_chain: Callable[..., RigidBody], record: Record, seed: int
) -> None:
    body = make_chain("rr")
    (finding,) = diagnose(body, record(body, lambda q: np.full_like(q, 0.3), 1.0, seed)).findings
    assert (finding.effect, finding.place.joint, finding.status) == ("torque_offset", 1, "named")


def test_an_asymmetric_friction_stands_beside_all_that_it_would_replace(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """Coulomb's friction and an offset make what it makes: neither is sure where the other is not."""
    body = make_chain("rr")
    recordings = played(body, make_periodic, lambda t, q, dq: 0.4 * np.where(dq > 0.0, 1.0, -0.55))
    found = diagnose(body, recordings).findings
    assert {(f.effect, f.status) for f in found} == {("coulomb_friction", "ambiguous"), ("torque_offset", "ambiguous")}
    assert all("asymmetric_friction" in [a.effect for a in f.alternatives] for f in found)


@pytest.mark.parametrize(
    ("level", "back", "beside"),
    [
        (0.05, 1.0, {"asymmetric_friction", "stribeck_friction"}),
        (0.06, 0.6, {"asymmetric_friction", "stribeck_friction"}),
        (0.06, 1.6, {"asymmetric_friction", "stribeck_friction"}),
        (0.4, 1.0, set()),
    ],
)
def test_friction_too_small_to_show_its_form_may_have_either(
    make_chain: Callable[..., RigidBody],
    make_periodic: Periodic,
    level: float,
    back: float,
    beside: set[str],
) -> None:
    """A joint that rubs twice as much one way, or from rest, would not show it beside this noise."""
    body = make_chain("rr")
    recordings = played(body, make_periodic, lambda t, q, dq: level * np.where(dq > 0.0, 1.0, -back))
    (finding,) = diagnose(body, recordings).findings
    assert (finding.effect, finding.place.joint) == ("coulomb_friction", 1)
    within = {a.effect: a.log_likelihood_gap for a in finding.alternatives if a.log_likelihood_gap < AMBIGUOUS}
    assert beside <= set(within)
    assert (finding.status == "ambiguous") == bool(beside)
    if not beside:
        # What such a motion shows well, it speaks against.
        gaps = {a.effect: a.log_likelihood_gap for a in finding.alternatives}
        assert gaps["asymmetric_friction"] > 30.0


@pytest.mark.parametrize(("back", "status"), [(0.98, "ambiguous"), (0.9, "named")])
def test_no_law_is_exact_to_a_hundredth_of_its_torque(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic, back: float, status: str
) -> None:
    """Friction of forty times its noise, hardly less one way: that shows, and may be the form of either law."""
    body = make_chain("rr")
    recordings = played(
        body, make_periodic, lambda t, q, dq: np.where(dq > 0.0, 1.0 + dq, back * (dq - 1.0)), noise=0.025
    )
    (asymmetric,) = [
        f for f in diagnose(body, recordings).findings if f.place.joint == 1 and f.effect == "asymmetric_friction"
    ]
    assert asymmetric.status == status
    gaps = {a.effect: a.log_likelihood_gap for a in asymmetric.alternatives}
    assert gaps["viscous_friction"] == 0.0 if status == "ambiguous" else gaps["viscous_friction"] > 30.0


def test_a_rise_from_rest_is_as_far_behind_the_viscous_friction_as_behind_the_dry_one(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """It is one of a dry friction, and where that has none, the viscous one beside it has none."""
    body = make_chain("rr")
    recordings = played(body, make_periodic, lambda t, q, dq: 0.4 * np.sign(dq) + 0.5 * dq, noise=0.3)
    found = {f.effect: f for f in diagnose(body, recordings).findings if f.place.joint == 1}
    assert {(name, f.status) for name, f in found.items()} == {
        ("coulomb_friction", "named"),
        ("viscous_friction", "named"),
    }
    dry, viscous = (
        next(a.log_likelihood_gap for a in found[name].rivals if a.effect == "stribeck_friction")
        for name in ("coulomb_friction", "viscous_friction")
    )
    assert dry == viscous > AMBIGUOUS


@pytest.mark.parametrize(("playings", "status"), [(2, "named"), (1, "ambiguous")])
def test_only_a_motion_that_is_played_again_tells_a_drift(
    make_chain: Callable[..., RigidBody],
    make_periodic: Periodic,
    playings: int,
    status: str,
) -> None:
    """Played once, it may be a friction of the places where the joint is late in the motion."""
    body = make_chain("rr")

    def drifting(t: Array, q: Array, dq: Array) -> Array:
        return np.asarray((0.5 + np.exp(-t / 8.0)) * np.sign(dq))

    recordings = played(body, make_periodic, drifting, motions=2, seconds=25.0, playings=playings, noise=0.3)
    (finding,) = diagnose(body, recordings).findings
    assert (finding.effect, finding.place.joint, finding.status) == ("friction_drift", 1, status)
    if status == "ambiguous":
        assert [a.effect for a in finding.alternatives] == ["coulomb_friction"]


def test_what_goes_with_the_temperature_is_no_matter_of_the_friction_s_form(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """A rise from rest may be there besides, where noise would hide it; it warms no joint. Held against it, as against
    a plain friction, it came to 19 nats."""
    body = make_chain("rr")

    def warmth(t: Array) -> Array:
        return np.asarray(30.0 + 10.0 * np.sin(2.0 * np.pi * t / 11.0))

    def cooling(t: Array, q: Array, dq: Array) -> Array:
        return np.asarray((2.0 - 0.04 * (warmth(t) - 20.0)) * np.sign(dq))

    recordings = [
        replace(one, temperature=np.stack([np.full(one.samples, np.nan), warmth(one.t)], axis=1))
        for one in played(body, make_periodic, cooling, motions=2, seconds=12.0, noise=2.0)
    ]
    (finding,) = diagnose(body, recordings).findings
    assert (finding.effect, finding.place.joint, finding.status) == ("friction_drift", 1, "named")
    assert "initial_temperature" in finding.parameters
    assert min(rival.log_likelihood_gap for rival in finding.rivals) > 50.0


@pytest.mark.parametrize(("wide", "signs"), [("stribeck_friction", (1.0,)), ("asymmetric_friction", (1.0, -1.0))])
def test_what_speaks_against_a_usual_form_is_the_misfit_of_that_form(
    make_chain: Callable[..., RigidBody], wide: str, signs: tuple[float, ...]
) -> None:
    """Of the plain law with its usual companion, at one level for both, against the plain law alone."""
    body, random = make_chain("r"), np.random.default_rng(6)
    base, plain, law = base_parameters(body), catalogue()["coulomb_friction"], catalogue()[wide]
    given, usual = base.rank + 1, np.array(law.typical["coulomb_friction"])
    rows = random.normal(size=(given + 1 + len(usual), 300))
    # What stands beside a law looks much like it.
    rows[given + 1 :] += 0.8 * rows[given]
    residual = rows.T @ np.append(random.normal(size=given + 1), 0.3 * usual) + random.normal(size=300)
    free, columns = np.full(1, np.inf), np.arange(given + 1, given + 1 + len(usual))
    candidates = (
        Candidate(0, np.zeros(0), np.array([given]), (0,), -free, free),
        Candidate(1, np.zeros(0), columns, (0,), -np.repeat(free, len(usual)), np.repeat(free, len(usual))),
    )
    told = np.eye(given)
    design = Design(body, base, (Channel("torque", 0),), (), candidates, told, (np.arange(base.rank),))
    whole = np.vstack([rows, residual])
    model = Conditional(Weighted(design, Block(0, 300, [whole @ whole.T]), np.ones(1)), np.arange(given + 1))

    def misfit(last: Array) -> float:
        """Half the square of what is left, the given unknowns within their prior."""
        matrix = np.vstack([np.vstack([rows[:given], last]).T, np.eye(given, given + 1)])
        return 0.5 * float(np.linalg.lstsq(matrix, np.append(residual, np.zeros(given)), rcond=None)[1][0])

    found = against_typical(model, plain, np.array([given]), law, [columns])
    best = min(misfit(rows[given] + sign * usual @ rows[columns]) for sign in signs)
    assert found == pytest.approx(best - misfit(rows[given]), rel=1e-6)


def test_a_usual_form_goes_with_the_larger_level_of_a_friction_that_drifts(
    make_chain: Callable[..., RigidBody],
) -> None:
    """A joint that rubs hardly at first rises from rest by what it rubs later."""
    body, random = make_chain("r"), np.random.default_rng(6)
    base, given = base_parameters(body), base_parameters(body).rank + 1
    law, rise = catalogue()["stribeck_friction"], np.arange(given + 2, given + 5)
    rows = random.normal(size=(given + 5, 300))
    residual = rows.T @ np.array([*np.zeros(given), 0.01, 0.4, 0.0, 0.0, 0.0]) + 0.1 * random.normal(size=300)
    free = np.full(3, np.inf)
    candidates = (
        Candidate(0, np.zeros(0), np.array([given, given + 1]), (0,), -free[:2], free[:2]),
        Candidate(1, np.zeros(0), rise, (0,), -free, free),
    )
    reached = (np.arange(base.rank),)
    design = Design(body, base, (Channel("torque", 0),), (), candidates, np.eye(given), reached)
    whole = np.vstack([rows, residual])
    model = Conditional(Weighted(design, Block(0, 300, [whole @ whole.T]), np.ones(1)), np.arange(given + 2))
    against = {
        name: against_typical(model, catalogue()[name], np.array(columns), law, [rise])
        for name, columns in (("friction_drift", [given, given + 1]), ("coulomb_friction", [given + 1]))
    }
    assert against["friction_drift"] == against["coulomb_friction"]
    assert against["friction_drift"] is not None and against["friction_drift"] > 3.0
