"""What hides behind friction of every joint, as all arms have it: effects no larger than twice the noise, beside
friction that is four times as large. The friction's laws here are not those of the catalogue's files."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.evidence.maps import MEMORY, Map
from estimator.diagnosis.evidence.scores import Scores
from estimator.diagnosis.naming.admission import Admission
from estimator.diagnosis.naming.rivals import AMBIGUOUS

Array = NDArray[np.float64]
Law = Callable[[Array, Array, Array], Array]

NOISE = np.array([0.5, 0.6, 0.4, 0.2, 0.1, 0.05])
"""N·m, white."""
LEVEL = 4.0 * NOISE * np.array([1.4, 0.8, 1.1, 0.7, 1.3, 0.9])
"""N·m, of the dry friction and of the viscous one at 2 rad/s."""
EVERYWHERE = {"coulomb_friction", "viscous_friction"}


def soft(dq: Array) -> Array:
    """A sign as sharp as 3 mrad/s."""
    return np.asarray(np.tanh(dq / 0.003))


def bristles(dq: Array) -> Array:
    """LuGre's bristles of 0.1 mrad, damped by 8 ms, step by step at 250 Hz."""
    give, damped, step = 1e-4, 8e-3, 4e-3
    bent = np.zeros_like(dq)
    for k in range(1, len(dq)):
        bent[k] = (bent[k - 1] + step * dq[k]) / (1.0 + step * np.abs(dq[k]) / give)
    return np.asarray((bent + damped * np.gradient(bent, step, axis=0)) / give)


@pytest.fixture(scope="module")
def record(
    six_axis: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> Callable[..., list[Trajectory]]:
    def make(
        law: Law | None = None, gain: Array | None = None, dry: Callable[[Array], Array] = soft
    ) -> list[Trajectory]:
        random = np.random.default_rng(3)
        true = six_axis.prior() * (1.0 + 0.02 * np.repeat(random.normal(size=six_axis.n), 10))
        result = []
        for motion in range(3):
            t, q, dq, ddq = make_periodic(six_axis.n, 8.0, 250.0, 7 + motion)
            q, dq, ddq = 0.6 * (q - 2.0) + 0.3, 0.6 * dq, 0.6 * ddq
            tau = inverse_dynamics(six_axis, true, q, dq, ddq) + LEVEL * (dry(dq) + 0.5 * dq)
            tau += 0.0 if law is None else law(q, dq, ddq)
            for playing in range(2):
                measured = q + 5e-6 * random.normal(size=q.shape)
                noisy = tau * (1.0 if gain is None else gain) + NOISE * random.normal(size=q.shape)
                result.append(Trajectory(t, measured, noisy, name=f"motion {motion}, playing {playing}"))
        return result

    return make


def beside_friction(found: object) -> set[tuple[str, int | None, str]]:
    return {(f.effect, f.place.joint, f.status) for f in found.findings if f.effect not in EVERYWHERE}  # type: ignore[attr-defined]


def test_friction_of_every_joint_is_named_and_nothing_else(six_axis: RigidBody, record: Callable[..., object]) -> None:
    found = diagnose(six_axis, record())  # type: ignore[arg-type]
    assert beside_friction(found) == set()
    assert {(f.effect, f.place.joint) for f in found.findings} == {(e, j) for e in EVERYWHERE for j in range(6)}
    assert found.verdict == "named"


def test_friction_of_bristles_is_told_once(six_axis: RigidBody, record: Callable[..., object]) -> None:
    found = diagnose(six_axis, record(dry=bristles))  # type: ignore[arg-type]
    told = sorted((f.effect, f.place.joint) for f in found.findings)
    assert told == sorted((effect, joint) for effect in EVERYWHERE for joint in range(6))
    assert not found.unexplained


@pytest.mark.parametrize(
    ("effect", "joint", "law"),
    [
        ("joint_spring", 1, lambda q, dq, ddq: 2.2 * (q[:, 1] - 0.2)),
        ("rotor_inertia", 2, lambda q, dq, ddq: 0.2 * ddq[:, 2]),
        ("cogging", 3, lambda q, dq, ddq: 0.3 * np.sin(7.0 * q[:, 3] + 0.4)),
    ],
)
def test_what_is_small_beside_the_friction_is_named_still(
    six_axis: RigidBody, record: Callable[..., object], effect: str, joint: int, law: Law
) -> None:
    def on_joint(q: Array, dq: Array, ddq: Array) -> Array:
        torque = np.zeros_like(q)
        torque[:, joint] = law(q, dq, ddq)
        return torque

    assert beside_friction(diagnose(six_axis, record(on_joint))) == {(effect, joint, "named")}  # type: ignore[arg-type]


def test_a_torque_constant_is_named_beside_friction(six_axis: RigidBody, record: Callable[..., object]) -> None:
    gain = np.array([1.0, 1.0, 0.975, 1.0, 1.0, 1.0])
    found = diagnose(six_axis, record(gain=gain))  # type: ignore[arg-type]
    assert beside_friction(found) == {("torque_constant_error", 2, "named")}


@pytest.mark.parametrize("offset", [0.2, 0.03])
def test_an_offset_beside_friction_may_be_friction_that_is_not_the_same_both_ways(
    six_axis: RigidBody, record: Callable[..., list[Trajectory]], offset: float
) -> None:
    """They make the same torque in every motion, and are told apart by what the drives read while they are off."""
    vector = np.array([0.0, 0.0, 0.0, 0.0, offset, 0.0])
    recordings = record(lambda q, dq, ddq: vector * np.ones_like(q))
    found = diagnose(six_axis, recordings)
    (own,) = [f for f in found.findings if f.effect == "torque_offset"]
    assert own.place.joint == 4
    assert abs(float(own.parameters["offset"].value) - offset) < 0.01
    near = {a.effect: a.log_likelihood_gap for a in own.rivals if a.place == own.place}
    assert near["asymmetric_friction"] < AMBIGUOUS
    assert beside_friction(found) == {("torque_offset", 4, "ambiguous")}
    random, t = np.random.default_rng(4), np.arange(15_000) / 250.0
    still = 0.3 + 5e-6 * random.normal(size=(len(t), six_axis.n))
    off = Trajectory(t, still, vector + NOISE * random.normal(size=still.shape), name="drives off")
    assert beside_friction(diagnose(six_axis, recordings, drives_off=[off])) == {("torque_offset", 4, "named")}


def test_all_rotors_are_named_beside_friction_of_many_times_the_noise(
    six_axis: RigidBody, record: Callable[..., list[Trajectory]]
) -> None:
    """Each a hundredth of what its joint's friction explains, whose level goes with the angle a little; and no link is
    said to be off in the stead of two rotors."""
    rotors = 5.0 * NOISE / np.array([6.0, 6.0, 6.0, 9.0, 9.0, 9.0])

    def law(q: Array, dq: Array, ddq: Array) -> Array:
        level = 4.0 * LEVEL * (1.0 + 0.07 * np.tanh(2.0 * q))
        return np.asarray(level * soft(dq) + 2.0 * LEVEL * dq + rotors * ddq)

    findings = diagnose(six_axis, record(law)).findings
    told = {f.place.joint: f for f in findings if f.effect == "rotor_inertia"}
    assert set(told) == set(range(6))
    assert "link_inertia" not in {f.effect for f in findings}
    for joint, inertia in enumerate(rotors):
        own = told[joint].parameters["inertia"]
        assert abs(float(own.value) - inertia) < 3.0 * float(own.standard_error) + 0.05 * inertia


def goes_with(law: object) -> bool:
    """Whether it is a function of what a friction is one of."""
    return isinstance(law, Map) and law.quantity in ("speed", MEMORY) and not law.of_neighbour


def test_a_rotor_is_no_trifle_for_being_small_beside_a_friction_whose_forms_do_not_mend_it(
    six_axis: RigidBody, record: Callable[..., list[Trajectory]]
) -> None:
    """Whatever else is left: what speed and travel explain it does not, and a twentieth of the friction is less."""
    joint = 2
    rotor = 1.8 * NOISE[joint] * (np.arange(6) == joint)
    evidence = gather(six_axis, record(lambda q, dq, ddq: 4.0 * LEVEL * (soft(dq) + 0.5 * dq) + rotor * ddq), 0.05)
    scores = Scores(evidence.design, evidence.blocks, evidence.folds, evidence.noise.news)
    admission, chosen = Admission(scores), []
    causes = [(name, own) for own in range(six_axis.n) for name in sorted(EVERYWHERE)] + [("rotor_inertia", joint)]
    for cause in causes:
        told = [(h.effect.name, h.place.joint) for h in map(scores.hypothesis, range(len(scores.owner)))]
        gains = scores.gains(chosen)
        chosen.append(max((k for k, own in enumerate(told) if own == cause), key=lambda k: float(gains[k])))
    scores.reweigh(chosen)
    maps = [k for k in range(len(scores.owner)) if isinstance(scores.hypothesis(k).effect, Map)]
    forms = [k for k in maps if (h := scores.hypothesis(k)).place.joint == joint and goes_with(h.effect)]
    much = np.full(len(evidence.design.channels), 1e3)
    coulomb, inertia = chosen[causes.index(("coulomb_friction", joint))], chosen[-1]
    assert admission.told(inertia, chosen, much) < 1.0 < admission.told(inertia, chosen, much, forms)
    # A friction is held against what it could mend.
    lost = scores.explained([coulomb], [k for k in (*chosen, *forms) if k != coulomb])[joint]
    whole = scores.explained([coulomb], [k for k in chosen if k != coulomb])[joint]
    assert admission.told(coulomb, chosen, much, forms) == pytest.approx(
        admission.told(coulomb, chosen, much) * lost / whole, rel=0.1
    )


def test_a_joint_may_have_more_than_three_causes(
    make_chain: Callable[..., RigidBody], play_twice: Callable[..., list[Trajectory]]
) -> None:
    body = make_chain("rr")

    def law(q: Array, dq: Array) -> Array:
        return np.asarray(np.tanh(dq / 0.003) + 0.8 * dq + 1.5 * (q - 0.2) + 0.4 * np.sin(9.0 * q + 0.5))

    found = diagnose(body, play_twice(body, law, noise=0.05))
    told = {(f.effect, f.place.joint) for f in found.findings}
    assert told >= {(e, j) for e in (*EVERYWHERE, "joint_spring", "cogging") for j in range(2)}
