"""The diagnosis on simulated recordings of a six-axis arm: what it names, what it does not."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np
import pytest
from numpy.typing import NDArray
from scipy.signal import lfilter

from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose

Array = NDArray[np.float64]
Law = Callable[[Array, Array, Array], Array]
Recorder = Callable[..., list[Trajectory]]

NOISE = np.array([0.9, 1.2, 0.7, 0.3, 0.15, 0.1])
"""N·m, white."""


@pytest.fixture(scope="module")
def record(
    six_axis: RigidBody, make_periodic: Callable[..., tuple[Array, Array, Array, Array]]
) -> Callable[..., list[Trajectory]]:
    """Two playings of two motions, the arm's link parameters being off by some percent, ``law(q, dq, ddq)`` added."""

    def make(law: Law | None = None, seed: int = 0, playings: int = 2, slow: bool = False) -> list[Trajectory]:
        random = np.random.default_rng(seed)
        true = six_axis.prior() * (1.0 + 0.02 * np.repeat(random.normal(size=six_axis.n), 10))
        result = []
        for motion in range(2):
            t, q, dq, ddq = make_periodic(six_axis.n, 8.0, 250.0, 10 * seed + motion)
            tau = inverse_dynamics(six_axis, true, q, dq, ddq) + (0.0 if law is None else law(q, dq, ddq))
            for playing in range(playings):
                measured = q + 1e-6 * random.normal(size=q.shape)
                noise = NOISE * random.normal(size=q.shape)
                if slow:
                    noise = 0.6 * noise + 0.8 * lfilter(
                        [0.31], [1.0, -0.95], NOISE * random.normal(size=q.shape), axis=0
                    )
                result.append(Trajectory(t, measured, tau + noise, name=f"motion {motion}, playing {playing}"))
        return result

    return make


def on(joint: int, torque: Array, like: Array) -> Array:
    result = np.zeros_like(like)
    result[:, joint] = torque
    return result


def test_what_one_joint_spends_beside_a_viscous_coupling_may_be_the_other_s(
    six_axis: RigidBody, record: Recorder
) -> None:
    """Both sums are the same matrix of speeds: no motion tells them apart, and none is promised to."""
    both, ratio, own = 30.0, 0.8, 10.0

    def law(q: Array, dq: Array, ddq: Array) -> Array:
        spent = both * (dq[:, 3] + ratio * dq[:, 4])
        return on(3, spent, dq) + on(4, ratio * spent + own * dq[:, 4], dq)

    def other(q: Array, dq: Array, ddq: Array) -> Array:
        """With what is joint 5's own at joint 4."""
        taken = (both * ratio) ** 2 / (both * ratio**2 + own)
        another = both * ratio / taken
        spent = taken * (dq[:, 3] + another * dq[:, 4])
        return on(3, spent + (both - taken) * dq[:, 3], dq) + on(4, another * spent, dq)

    speeds = np.random.default_rng(0).normal(size=(10, 6))
    assert np.allclose(law(speeds, speeds, speeds), other(speeds, speeds, speeds))
    found = diagnose(six_axis, record(law))
    told = {f.effect: f for f in found.findings}
    assert set(told) == {"transmission_coupling", "viscous_friction"}
    viscous = told["viscous_friction"]
    assert viscous.status == "ambiguous"
    (alternative,) = viscous.alternatives
    assert {viscous.place.joint, alternative.place.joint} == {3, 4}
    assert (alternative.effect, alternative.log_likelihood_gap, alternative.decidable) == (
        "viscous_friction",
        0.0,
        False,
    )
    assert (viscous.contest, viscous.next_experiment) == (None, None)
    assert any("no motion tells the viscous friction" in note for note in found.notes)


def test_a_clean_arm_is_clean(six_axis: RigidBody, record: Recorder) -> None:
    found = diagnose(six_axis, record())
    assert found.verdict == "clean"
    assert found.findings == ()
    assert found.detectable_units["viscous_friction"] == "N·m·s/rad"
    sizes = found.smallest_detectable["viscous_friction"]
    assert set(sizes) == set(range(6))
    assert 0.0 < sizes[5] < sizes[0]


def test_friction_of_one_joint_is_named_with_its_size(six_axis: RigidBody, record: Recorder) -> None:
    found = diagnose(six_axis, record(lambda q, dq, ddq: on(2, 0.5 * dq[:, 2], dq)))
    assert [(f.effect, f.place.joint, f.status) for f in found.findings] == [("viscous_friction", 2, "named")]
    coefficient = found.findings[0].parameters["coefficient"]
    assert abs(float(coefficient.value) - 0.5) < 4.0 * float(coefficient.standard_error) < 0.2
    assert found.torque_residual[2].after < found.torque_residual[2].before
    assert found.held_out.share_of_explainable > 0.7


def test_two_causes_at_once_are_both_named(six_axis: RigidBody, record: Recorder) -> None:
    def law(q: Array, dq: Array, ddq: Array) -> Array:
        return on(1, 0.8 * np.tanh(dq[:, 1] / 0.005), dq) + on(4, 0.05 * ddq[:, 4], dq)

    found = diagnose(six_axis, record(law, seed=1))
    named = {(f.effect, f.place.joint) for f in found.findings}
    assert ("coulomb_friction", 1) in named
    assert ("rotor_inertia", 4) in named


def test_one_late_drive_is_named_at_its_joint(six_axis: RigidBody, record: Recorder) -> None:
    """12 ms, which its timing would take if it were believed once it is bent so far beyond its tolerance."""

    def late(q: Array, dq: Array, ddq: Array) -> Array:
        tau = inverse_dynamics(six_axis, six_axis.prior(), q, dq, ddq)[:, 2]
        return on(2, np.roll(tau, 3) - tau, q)

    (found,) = diagnose(six_axis, record(late)).findings
    assert (found.effect, found.place.joint, found.place.channel) == ("transport_delay", 2, "torque")
    assert found.parameters["delay"].value == pytest.approx(0.012, rel=0.2)


@pytest.mark.parametrize("seed", range(4))
def test_a_part_of_a_law_that_is_not_there_does_not_hide_the_law(
    six_axis: RigidBody, record: Recorder, seed: int
) -> None:
    """A shared transmission without dry friction: noise makes its level negative half the time."""

    def shared(q: Array, dq: Array, ddq: Array) -> Array:
        spent = 3.0 * (dq[:, 3] - dq[:, 4])
        return on(3, spent, q) - on(4, spent, q)

    found = diagnose(six_axis, record(shared, seed))
    first = found.findings[0]
    assert (first.effect, first.place.joint, first.place.other) == ("transmission_coupling", 3, 4)
    assert first.parameters["coefficient"].value == pytest.approx(3.0, rel=0.1)
    assert first.parameters["ratio"].value == pytest.approx(-1.0, abs=0.1)
    assert first.parameters["level"].value >= 0.0


def test_a_rotor_that_two_joints_turn(six_axis: RigidBody, record: Recorder) -> None:
    """As behind a wrist, whose motors turn with the joints before theirs: no link has that inertia, and no friction."""

    def shared(q: Array, dq: Array, ddq: Array) -> Array:
        spent = 0.2 * (ddq[:, 4] + 0.6 * ddq[:, 5])
        return on(4, spent, q) + on(5, 0.6 * spent, q)

    (found,) = diagnose(six_axis, record(shared, 1)).findings
    assert (found.effect, found.place.joint, found.place.other) == ("transmission_coupling", 4, 5)
    inertia, ratio = found.parameters["inertia"], found.parameters["ratio"]
    assert inertia.value == pytest.approx(0.2, rel=0.1)
    assert abs(float(inertia.value) - 0.2) < 4.0 * float(inertia.standard_error)
    assert ratio.value == pytest.approx(0.6, abs=0.05)
    assert found.parameters["level"].value == pytest.approx(0.0, abs=0.02)


def test_soft_friction_that_two_joints_share_has_the_ratio_and_the_level_that_it_has(
    six_axis: RigidBody, record: Recorder
) -> None:
    """Bristles make any sign soft: one that stayed sharp would take that up with its ratio and its level."""
    level, ratio, soft = 6.0, 1.0, 0.2

    def shared(q: Array, dq: Array, ddq: Array) -> Array:
        spent = level * np.tanh((dq[:, 4] + ratio * dq[:, 5]) / soft)
        return on(4, spent, q) + on(5, ratio * spent, q)

    (found,) = diagnose(six_axis, record(shared, 2)).findings
    assert (found.effect, found.place.joint, found.place.other) == ("transmission_coupling", 4, 5)
    for name, true in (("level", level), ("ratio", ratio)):
        told = found.parameters[name]
        assert abs(float(told.value) - true) < 3.0 * float(told.standard_error) < 0.02 * true, name


def test_without_repeats_the_noise_is_assumed_and_the_answer_says_so(six_axis: RigidBody, record: Recorder) -> None:
    found = diagnose(six_axis, record(playings=1))
    assert found.verdict == "clean"
    assert any("no motion was played twice" in note for note in found.notes)


@pytest.mark.parametrize("seed", range(3))
def test_slow_noise_that_no_repeats_tell_is_no_cause(six_axis: RigidBody, record: Recorder, seed: int) -> None:
    found = diagnose(six_axis, record(seed=seed, playings=1, slow=True))
    assert found.verdict == "clean", (found.findings, found.unexplained)


def test_links_that_are_all_off_make_the_model_doubtful(six_axis: RigidBody, record: Recorder) -> None:
    def other_links(q: Array, dq: Array, ddq: Array) -> Array:
        more = six_axis.prior().reshape(-1, 10) * np.array([0.0, 0.8, 0.0, -0.6, 0.0, 0.0])[:, None]
        return inverse_dynamics(six_axis, more.ravel(), q, dq, ddq)

    found = diagnose(six_axis, record(other_links))
    assert {f.place.joint for f in found.findings if f.effect == "link_inertia"} == {1, 3}
    assert any("make sure that the model is this arm's" in note for note in found.notes)
    assert not any("make sure" in note for note in diagnose(six_axis, record()).notes)
