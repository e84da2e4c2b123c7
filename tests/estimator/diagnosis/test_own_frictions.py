"""Frictions that are others in each recording: what they differ by is told, and hides nothing."""

from __future__ import annotations

from collections.abc import Callable, Sequence

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.drives import with_drives
from estimator.diagnosis.evidence.conditional import Conditional
from estimator.diagnosis.evidence.design import Candidate
from estimator.diagnosis.evidence.gathered import Evidence, gather, weighed_again
from estimator.diagnosis.evidence.own_frictions import (
    apart_by,
    fitted_with_own,
    of_own_frictions,
    spreads_of,
    with_own_frictions,
)
from estimator.diagnosis.evidence.refinement import fitted
from estimator.diagnosis.naming.accuracy import searched
from estimator.diagnosis.naming.restless import RESTLESS, with_restless_frictions
from estimator.diagnosis.observed.own_friction import OWN, courses
from estimator.diagnosis.telling.answer import Diagnosis, Finding

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]
Torque = Callable[[Array, Array, Array], Array]
NOISE, SECONDS, RATE, RECORDINGS = 0.05, 10.0, 200.0, 8
DRY, VISCOUS = 3.0, 5.0
FALLING = 1.0 - 0.3 * (1.0 - np.exp(-np.arange(RECORDINGS) / 3.0))
"""Of the first recording's friction, that of each."""
SCATTERED = 1.0 + 0.15 * np.random.default_rng(8).normal(size=RECORDINGS)


def played(
    body: RigidBody, make_periodic: Periodic, shares: Array, beside: Torque | None = None, motions: int = RECORDINGS
) -> list[Trajectory]:
    """Recordings of so many ``motions``, in turn, of which each has its share of a friction of the second joint;
    ``beside``: another torque there, N·m of q, dq and ddq."""
    random, recordings = np.random.default_rng(3), []
    for number, share in enumerate(shares):
        t, q, dq, ddq = make_periodic(2, SECONDS, RATE, number % motions)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + NOISE * random.normal(size=q.shape)
        tau[:, 1] += share * (DRY * np.tanh(dq[:, 1] / 0.01) + VISCOUS * dq[:, 1])
        if beside is not None:
            tau[:, 1] += beside(q[:, 1], dq[:, 1], ddq[:, 1])
        recordings.append(Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau, name=f"recording {number}"))
    return recordings


def told(found: Diagnosis) -> dict[str, Finding]:
    return {finding.effect: finding for finding in found.findings}


def fitted_beside(evidence: Evidence, channels: Sequence[int]) -> Conditional:
    """With a dry and a viscous friction of each joint."""
    plain: dict[int, Candidate] = {}
    for candidate in evidence.design.candidates:
        if evidence.design.hypotheses[candidate.hypothesis].effect.name in ("coulomb_friction", "viscous_friction"):
            plain.setdefault(candidate.hypothesis, candidate)
    design = evidence.design.with_candidates(list(plain.values()))
    shown = evidence.pieces, evidence.decimations, evidence.noise, np.ones(len(design.channels))
    return fitted_with_own(design, channels, *shown)


@pytest.mark.parametrize("shares", [FALLING, SCATTERED])
def test_recordings_tell_by_how_much_frictions_differ(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic, shares: Array
) -> None:
    evidence = gather(make_chain("rr"), played(make_chain("rr"), make_periodic, shares), 0.05)
    model = fitted_beside(evidence, [0, 1])
    own = model.design
    for spread, friction in zip(spreads_of(own)[1], (DRY, VISCOUS), strict=True):
        assert spread == pytest.approx(friction * np.std(shares), rel=0.35)
    each = np.einsum("rcp,cp->rp", courses(own.vigour[:, 1]), model.value[own.own_frictions(1)])
    value = each[:-1]
    np.testing.assert_allclose(value - value.mean(axis=0), np.outer(shares - shares.mean(), (DRY, VISCOUS)), atol=0.2)
    # A recording that was not made has none yet, and the joint that does not rub has none to differ.
    np.testing.assert_allclose(model.value[own.own_frictions(1)[-1]], 0.0)
    assert of_own_frictions(model, 0) < 0.05 * of_own_frictions(model, 1)


@given(arrays(float, st.tuples(st.integers(2, 9), st.just(OWN)), elements=st.floats(0.0, 1e6)))
def test_courses_are_orthonormal_and_only_the_first_goes_with_the_vigour(vigour: Array) -> None:
    """So a joint that moves in one recording alone has no friction of its own there."""
    for own, energy in zip(np.moveaxis(courses(vigour), -1, 0), vigour.T, strict=True):
        np.testing.assert_allclose(own @ own.T, np.eye(len(energy) + 1), atol=1e-9)
        np.testing.assert_allclose(energy @ own[:-1, 1:], 0.0, atol=1e-9 * max(float(energy.max()), 1.0))


def test_what_all_recordings_have_is_not_their_own(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """Else they would stand for the friction itself, and that would be a trifle."""
    body = make_chain("rr")
    evidence = gather(body, played(body, make_periodic, np.ones(RECORDINGS)), 0.05)
    model = fitted_beside(evidence, [1])
    spreads = {1: np.array([DRY, VISCOUS])}
    wide = with_own_frictions(model.design, spreads)
    assert np.allclose(spreads_of(wide)[1], spreads[1])
    links = np.arange(wide.given)
    explained = {}
    for name, precision in (("none", wide.precision), ("any", apart_by(wide))):
        alone = Conditional(model.told.believed(precision), links)
        explained[name] = of_own_frictions(alone, 1)
    assert explained["none"] < 0.1 * explained["any"]


def test_frictions_alike_are_not_told_apart(make_chain: Callable[..., RigidBody], make_periodic: Periodic) -> None:
    body = make_chain("rr")
    found = diagnose(body, played(body, make_periodic, np.ones(RECORDINGS)))
    assert {(f.effect, f.place.joint, f.status) for f in found.findings} == {
        ("coulomb_friction", 1, "named"),
        ("viscous_friction", 1, "named"),
    }
    assert not any("another one in each" in note for note in found.notes)
    assert not found.unexplained


def test_what_was_taken_for_them_is_dropped_once_the_causes_leave_none(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """As where torques were late, and are known to be."""
    evidence = gather(make_chain("rr"), played(make_chain("rr"), make_periodic, np.ones(RECORDINGS), motions=4), 0.05)
    design = with_own_frictions(evidence.design, {1: np.array([DRY, VISCOUS])})
    wide = weighed_again(evidence, design, evidence.unseen, evidence.pieces, evidence.slow)
    found = searched(wide)
    refined = fitted(wide, found.scores, found.chosen)
    assert wide.design.restless == refined.design.restless == (1,)
    without = with_restless_frictions(wide, found.scores, found.chosen, refined)
    assert without is not None
    assert without.design.restless == ()


@pytest.mark.parametrize("motions", [RECORDINGS, RECORDINGS // 2])
@pytest.mark.parametrize("shares", [FALLING, SCATTERED])
def test_they_hide_no_spring_and_widen_the_errors(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic, shares: Array, motions: int
) -> None:
    """Of half the size of what the frictions differ by, whether each motion was played once or twice."""
    body = make_chain("rr")
    found = diagnose(body, played(body, make_periodic, shares, lambda q, dq, ddq: 1.5 * (q - 0.3), motions))
    by_name = told(found)
    assert set(by_name) == {"coulomb_friction", "viscous_friction", "joint_spring"}
    assert {finding.place.joint for finding in found.findings} == {1}
    spring = by_name["joint_spring"]
    assert spring.status == "named"
    for effect, parameter, true, spread in (
        ("joint_spring", "stiffness", 1.5, 0.0),
        ("coulomb_friction", "level", DRY * shares.mean(), DRY * shares.std()),
        ("viscous_friction", "coefficient", VISCOUS * shares.mean(), VISCOUS * shares.std()),
    ):
        quantity = by_name[effect].parameters[parameter]
        value, error = float(quantity.value), float(quantity.standard_error)
        assert abs(value - true) < 3.0 * error
        assert error > 0.5 * spread / np.sqrt(RECORDINGS)
    (note,) = (note for note in found.notes if "another one in each recording" in note)
    assert f"the friction of {body.joints[1]} is" in note
    assert all(left.signature == RESTLESS for left in found.unexplained.values())


def test_what_was_held_out_has_the_mean_friction(make_chain: Callable[..., RigidBody], make_periodic: Periodic) -> None:
    """And not that of the recording with its number."""
    body, shares = make_chain("rr"), np.append(1.6, SCATTERED[1:])
    judging = played(body, make_periodic, np.array([1.6]))
    found = diagnose(body, played(body, make_periodic, shares), judging)
    assert any("another one in each recording" in note for note in found.notes)
    _, _, dq, _ = make_periodic(2, SECONDS, RATE, 0)
    missed = (1.6 - shares.mean()) * (DRY * np.tanh(dq[:, 1] / 0.01) + VISCOUS * dq[:, 1])
    # Over both joints, of which the other has the noise alone.
    assert found.held_out.after == pytest.approx(np.sqrt(0.5 * np.mean(missed**2)), rel=0.15)
    assert found.traces.recording == 0


def test_drives_whose_frictions_differ_say_so(make_chain: Callable[..., RigidBody], make_periodic: Periodic) -> None:
    """Between a motor and its joint's sensor."""
    body = make_chain("rr")
    sensors, motors = (played(body, make_periodic, share * SCATTERED) for share in (0.0, 1.0))
    found = with_drives(diagnose(body, sensors), body, motors, sensors)
    assert {(f.effect, f.place.joint, f.place.channel) for f in found.findings} == {
        ("coulomb_friction", 1, "motor"),
        ("viscous_friction", 1, "motor"),
    }
    assert any("another one in each recording" in note for note in found.notes)
    assert found.unexplained[1].signature == f"{RESTLESS}, between its motor and its sensor"
    assert found.verdict in ("named", "ambiguous")
