"""What drives read while they are off, and what that decides."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import replace

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError
from estimator import RigidBody, Trajectory, inverse_dynamics
from estimator.diagnosis.diagnose import diagnose
from estimator.diagnosis.evidence.gathered import gather
from estimator.diagnosis.observed.drives_off import read_off
from estimator.diagnosis.telling.answer import Diagnosis

Array = NDArray[np.float64]
RATE = 250.0
NOISE = np.array([0.6, 0.5, 0.3])
OFFSET = np.array([0.0, 0.35, 0.0])


@pytest.fixture(scope="module")
def arm(make_chain: Callable[..., RigidBody]) -> RigidBody:
    return make_chain("rrr")


def at_rest(offset: Array, seed: int = 9, seconds: float = 20.0, grain: float = 0.0) -> Trajectory:
    """The arm, held by brakes, its torques in steps of ``grain``."""
    random, samples = np.random.default_rng(seed), round(seconds * RATE)
    q = 0.3 + 1e-6 * random.normal(size=(samples, 3))
    tau = offset + NOISE * random.normal(size=q.shape)
    return Trajectory(np.arange(samples) / RATE, q, grain * np.round(tau / grain) if grain else tau, name="off")


def test_offsets_are_read_within_their_errors(arm: RigidBody) -> None:
    off = [read_off(arm, [at_rest(OFFSET, seed, grain=0.2)]) for seed in range(40)]
    z = np.array([(one.offset - OFFSET) / one.error for one in off])
    assert 0.8 < z.std() < 1.3
    np.testing.assert_allclose(off[0].error, NOISE / np.sqrt(20.0 * RATE), rtol=0.5)
    both = read_off(arm, [at_rest(OFFSET, 1), at_rest(OFFSET, 2)])
    assert both.error.mean() < 0.85 * np.mean([one.error for one in off])


def test_rounding_to_coarse_steps_is_an_error_too(arm: RigidBody) -> None:
    read = [read_off(arm, [at_rest(OFFSET, seed, grain=4.0)]) for seed in range(5)]
    assert all(abs(one.offset[1] - 0.35) > 0.3 for one in read), "0.35 in steps of 4 hardly shows"
    assert all(abs(one.offset[1] - 0.35) < 3.0 * one.error[1] for one in read)


def test_a_drive_that_reads_one_number_measures_nothing(arm: RigidBody) -> None:
    off = at_rest(OFFSET)
    off.tau[:, 1] = 0.0
    assert read_off(arm, [off]).silent == [1]


def test_what_was_not_made_with_the_drives_off_is_refused(arm: RigidBody) -> None:
    off = at_rest(OFFSET)
    moving = replace(off, q=off.q + 0.1 * np.sin(off.t)[:, None])
    with pytest.raises(InputError, match=r"off: moves .* drives while they are off"):
        read_off(arm, [moving])
    still = np.zeros_like(off.q)
    held = replace(off, tau=off.tau + inverse_dynamics(arm, arm.prior(), off.q, still, still))
    with pytest.raises(InputError, match="off: holds the arm up"):
        read_off(arm, [held])


def swings(arm: RigidBody, law: Callable[[Array], Array]) -> list[Trajectory]:
    """Four motions, each twice, of an arm whose second joint spends ``law`` of its speed beside the model."""
    result = []
    for seed in range(8):
        amplitude, hertz = [((0.5, 0.8, 0.5), 0.25), ((0.6, 0.4, 0.4), 0.4), ((0.3, 0.9, 0.6), 0.33),
                            ((0.4, 0.6, 0.8), 0.2)][seed % 4]  # fmt: skip
        t, w, a = np.arange(round(12.0 * RATE)) / RATE, 2.0 * np.pi * hertz, np.array(amplitude)
        sine, cosine = np.sin(w * t)[:, None], np.cos(w * t)[:, None]
        q, dq, ddq = 0.3 + a * sine, a * w * cosine, -a * w**2 * sine
        tau = inverse_dynamics(arm, arm.prior(), q, dq, ddq)
        tau[:, 1] += law(dq[:, 1])
        random = np.random.default_rng(seed)
        measured = tau + NOISE * random.normal(size=q.shape)
        result.append(Trajectory(t, q + 1e-6 * random.normal(size=q.shape), measured))
    return result


def causes(found: Diagnosis) -> dict[str, str]:
    assert {finding.place.joint for finding in found.findings} == {1}
    return {finding.effect: finding.status for finding in found.findings}


def one_way_more(speed: Array) -> Array:
    """Rubs by 1.35 N·m one way and by 0.65 the other."""
    return np.asarray(np.where(speed > 0.0, 1.35, -0.65) + 0.4 * speed)


def test_an_offset_and_an_asymmetric_friction_are_told_apart_by_it_alone(arm: RigidBody) -> None:
    recordings = swings(arm, one_way_more)
    before = causes(diagnose(arm, recordings))
    assert set(before) == {"coulomb_friction", "viscous_friction", "torque_offset"}
    assert before["torque_offset"] == before["coulomb_friction"] == "ambiguous"
    offset = causes(diagnose(arm, recordings, drives_off=[at_rest(OFFSET)]))
    assert offset == {"coulomb_friction": "named", "viscous_friction": "named", "torque_offset": "named"}
    none = diagnose(arm, recordings, drives_off=[at_rest(0.0 * OFFSET)])
    assert causes(none) == {"asymmetric_friction": "named"}
    (friction,) = none.findings
    for name, true in (("level_positive", 1.35), ("level_negative", 0.65)):
        told = friction.parameters[name]
        assert abs(float(told.value) - true) < 3.0 * float(told.standard_error)


def bristles(level: float, more_one_way: float, bend: float) -> Callable[[Array], Array]:
    """Dahl's friction, which turns round within ``bend`` (rad) of travel, rubs more one way and has a viscous part."""

    def torque(speed: Array) -> Array:
        fine = 8
        between = np.interp(np.arange(fine * len(speed)) / fine, np.arange(len(speed)), speed)
        kept = np.exp(-np.abs(between) / (fine * RATE * bend))
        bent = np.zeros_like(between)
        for k in range(1, len(bent)):
            way = np.sign(between[k])
            bent[k] = way + (bent[k - 1] - way) * kept[k]
        return np.asarray(level * bent[::fine] + more_one_way * np.abs(bent[::fine]) + 0.4 * speed)

    return torque


def test_no_form_of_a_friction_bends_what_the_drives_read(arm: RigidBody) -> None:
    """The asymmetry, a twentieth of the level, explains less of the torque than any form of a friction is exact to;
    without it the drives would have an offset that they do not read."""
    recordings = swings(arm, bristles(10.0, 0.5, 2e-4))
    assert causes(diagnose(arm, recordings, drives_off=[at_rest(0.0 * OFFSET)])) == {"asymmetric_friction": "named"}


def sharp(level: float, more_one_way: float) -> Callable[[Array], Array]:
    return lambda speed: np.asarray(level * np.sign(speed) + more_one_way + 0.4 * speed)


@pytest.mark.parametrize("law", [sharp(10.0, 0.1), sharp(10.0, 0.3), bristles(10.0, 0.35, 2e-4)])
def test_an_offset_that_the_drives_do_not_read_is_no_alternative(arm: RigidBody, law: Callable[[Array], Array]) -> None:
    """However little of the torque the asymmetry is, unless bristles hide it: beside them, one of 0.3 is ambiguous."""
    (found,) = diagnose(arm, swings(arm, law), drives_off=[at_rest(0.0 * OFFSET)]).findings
    assert (found.effect, found.status) == ("asymmetric_friction", "named")
    assert all(other.log_likelihood_gap > 3.0 for other in found.alternatives)


def test_a_reading_is_as_exact_as_its_own_scatter_whatever_the_motions_noise_is(arm: RigidBody) -> None:
    off = at_rest(OFFSET)
    quiet = replace(off, tau=OFFSET + 0.1 * (off.tau - OFFSET))
    reading = gather(arm, swings(arm, one_way_more), 0.05, [quiet]).design.reading
    assert reading is not None
    np.testing.assert_allclose(reading.error, 0.1 * read_off(arm, [off]).error)


def test_a_silent_drive_is_told_and_decides_nothing(arm: RigidBody) -> None:
    off = at_rest(OFFSET)
    off.tau[:, 1] = 0.0
    found = diagnose(arm, swings(arm, one_way_more), drives_off=[off])
    assert causes(found)["torque_offset"] == "ambiguous"
    assert any(f"drives of {arm.joints[1]} measure nothing while they are off" in note for note in found.notes)
