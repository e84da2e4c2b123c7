"""Frictions that drift between the playings of a motion are told apart from their noise."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace
from functools import partial

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.drifts import drifts
from estimator.diagnosis.evidence.gathered import exactness, gather
from estimator.diagnosis.observed.repetition import lay, playings, repeated_noise

Array = NDArray[np.float64]
Periodic = Callable[..., tuple[Array, Array, Array, Array]]
NOISE, SECONDS, RATE = 0.3, 8.0, 200.0


def played(
    body: RigidBody,
    make_periodic: Periodic,
    torque: Callable[[Array, Array], Array],
    warmth: Callable[[Array], Array] | None = None,
) -> list[Trajectory]:
    """Three recordings of two joints, each a motion of so many seconds twice on end, with a torque of t and dq at the
    second beside the model's; ``warmth``: °C of that joint, at s of the whole session."""
    random, recordings = np.random.default_rng(2), []
    for motion in range(3):
        _, *once = make_periodic(2, SECONDS, RATE, motion)
        q, dq, ddq = (np.vstack([x, x]) for x in once)
        t = np.arange(len(q)) / RATE
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq)
        session = t + motion * 2.0 * SECONDS
        tau[:, 1] += torque(t if warmth is None else session, dq[:, 1])
        measured = q + 1e-6 * random.normal(size=q.shape)
        recordings.append(Trajectory(t, measured, tau + NOISE * random.normal(size=q.shape)))
        if warmth is not None:
            temperature = np.stack([np.full(len(t), np.nan), warmth(session)], axis=1)
            recordings[-1] = replace(recordings[-1], temperature=temperature)
    return recordings


def noises(body: RigidBody, recordings: list[Trajectory]) -> Array:
    return gather(body, recordings, 0.05).noise.rms


@pytest.mark.parametrize("dry", [True, False])
def test_what_drifts_is_no_noise(make_chain: Callable[..., RigidBody], make_periodic: Periodic, dry: bool) -> None:
    """Playings differ by many times as much, beside which a smaller cause would not be seen."""
    body = make_chain("rr")

    def drifting(t: Array, dq: Array) -> Array:
        return (2.0 + 4.0 * np.exp(-t / 6.0)) * (np.tanh(dq / 0.01) if dry else dq)

    still = noises(body, played(body, make_periodic, lambda t, dq: np.zeros_like(t)))
    recordings = played(body, make_periodic, drifting)
    half = len(recordings[0].t) // 2
    apart = np.concatenate([one.tau[:half, 1] - one.tau[half:, 1] for one in recordings])
    assert np.sqrt(0.5 * np.mean(apart**2)) > 4.0 * NOISE
    # Courses are told to a few time constants, and reversals to a row.
    assert np.all(noises(body, recordings) < 2.0 * still)
    (found,) = diagnose(body, recordings).findings
    assert (found.effect, found.place.joint, found.status) == ("friction_drift", 1, "named")
    initial, final = ("initial", "final") if dry else ("initial_coefficient", "final_coefficient")
    for name, true in ((initial, 6.0), (final, 2.0), ("time_constant", 6.0)):
        told = found.parameters[name]
        assert abs(float(told.value) - true) < 3.0 * float(told.standard_error or 0.0)


def test_grease_that_warms_through_a_session_is_told_at_both_ends(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    body = make_chain("rr")

    def warmth(t: Array) -> Array:
        return 45.0 - 20.0 * np.exp(-t / 25.0)

    recordings = played(body, make_periodic, lambda t, dq: (5.0 - 0.15 * (warmth(t) - 25.0)) * dq, warmth)
    (found,) = diagnose(body, recordings).findings
    assert (found.effect, found.place.joint, found.status) == ("friction_drift", 1, "named")
    told = {name: float(parameter.value) for name, parameter in found.parameters.items()}
    for end in ("initial", "final"):
        expected = 5.0 - 0.15 * (told[f"{end}_temperature"] - 25.0)
        error = float(found.parameters[f"{end}_coefficient"].standard_error or 0.0)
        assert abs(told[f"{end}_coefficient"] - expected) < 3.0 * error


def test_noise_alone_is_left_as_it_is(make_chain: Callable[..., RigidBody], make_periodic: Periodic) -> None:
    body = make_chain("rr")
    for law in (lambda t, dq: np.zeros_like(t), lambda t, dq: 3.0 * np.sign(dq) + dq):
        evidence = gather(body, played(body, make_periodic, law), 0.05)
        parts = evidence.design, evidence.pieces, evidence.grid, evidence.repeats
        rows = playings(evidence.repeats, evidence.grid, lay(evidence.pieces, [p.residual for p in evidence.pieces]))
        found = drifts(*parts, rows, partial(repeated_noise, unseen=evidence.unseen, exact=exactness(evidence.pieces)))
        for own, whole in zip(found.left, rows, strict=True):
            np.testing.assert_array_equal(own, whole)
        assert not found.restless


def test_a_friction_that_is_another_one_in_each_playing_is_told(
    make_chain: Callable[..., RigidBody], make_periodic: Periodic
) -> None:
    """Recordings begin anew, and nothing says how warm the joint was in each."""
    body, random, recordings = make_chain("rr"), np.random.default_rng(5), []
    for number in range(6):
        t, q, dq, ddq = make_periodic(2, SECONDS, RATE, number % 3)
        tau = inverse_dynamics(body, body.prior(), q, dq, ddq) + NOISE * random.normal(size=q.shape)
        tau[:, 1] += (5.0 - 0.4 * number) * dq[:, 1]
        recordings.append(Trajectory(t, q + 1e-6 * random.normal(size=q.shape), tau))
    assert gather(body, recordings, 0.05).design.restless == (1,)
    found = diagnose(body, recordings)
    assert {(f.effect, f.place.joint) for f in found.findings} == {("viscous_friction", 1)}
    (note,) = (note for note in found.notes if "another one in each" in note)
    assert f"the friction of {body.joints[1]} is" in note
