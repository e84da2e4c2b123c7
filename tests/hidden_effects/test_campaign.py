"""A small seeded part of the campaign, on the arm that is quickest to simulate: the figures must not fall.

`make campaign` measures the same over all arms, sizes and causes; these bounds are what that small part reaches, with
room for one scenario.
"""

from __future__ import annotations

import tempfile
from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from benchmarks.campaign.campaign import judged
from benchmarks.campaign.finding import in_process
from benchmarks.campaign.judging import Judgement
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.sealing import Question
from benchmarks.campaign.tally import tally

SEED = 11
KINDS = (
    "coulomb_friction",
    "base_tilt",
    "torque_offset",
    "rotor_inertia",
    "viscous_friction",
    "cogging",
)
SECONDS = 24.0


@pytest.fixture(scope="module")
def results() -> list[Judgement]:
    clean = [Plan(number, SEED, "dda", scatter=0.03, seconds=SECONDS) for number in range(2)]
    causes = [Plan(number, SEED, "dda", (kind,), 0.4, 0.03, SECONDS) for number, kind in enumerate(KINDS, len(clean))]
    return [judged(plan, in_process) for plan in (*clean, *causes)]


def values(results: list[Judgement]) -> dict[str, float]:
    return {f.name: f.value for f in tally(results) if f.count}


@pytest.mark.timeout(600)
def test_clean_arms_are_said_to_be_clean(results: list[Judgement]) -> None:
    assert values(results)["false alarms on clean arms, family-wise"] == 0.0, [r.sentence for r in results]


@pytest.mark.timeout(600)
def test_effects_below_the_noise_are_named_on_their_joints(results: list[Judgement]) -> None:
    shares = values(results)
    told = [r.sentence for r in results]
    # An offset, a tilt and an asymmetric friction make much the same torque where the links may be off.
    assert shares["effect and joint right, effect/noise 0.3 to 0.6"] >= 3 / 6, told
    assert shares["effect and joint right or in the set named, effect/noise 0.3 to 0.6"] == 1.0, told


@pytest.mark.timeout(600)
def test_nothing_is_confidently_wrong(results: list[Judgement]) -> None:
    assert not any(r.wrong for r in results), [r.sentence for r in results]


@pytest.mark.timeout(600)
def test_held_out_motion_is_better_explained(results: list[Judgement]) -> None:
    gains = [r.gain for r in results if r.right and r.truth.causes and r.gain is not None]
    assert float(np.median(gains)) > 0.9, [(r.sentence, r.gain) for r in results]


@pytest.mark.timeout(600)
def test_what_a_servo_answers_to_its_encoders_is_no_cause() -> None:
    """Coarse encoders, whose errors the servo's torque answers: a lag of the angles explains most of that noise."""
    result = judged(Plan(5, 707, "puma600", scatter=0.02, seconds=12.0), in_process)
    assert not result.wrong, result.sentence


def asked_of_few_samples(question: Question) -> Mapping[str, Any]:
    """With each motion played once, recorded at a quarter of the bus' rate: no repeats tell the noise."""
    with tempfile.TemporaryDirectory() as name:
        few = Question(Path(name))
        few.urdf.write_text(question.urdf.read_text())
        for recording in question.learnt[:3]:
            head, *rows = recording.read_text().splitlines()
            (few.folder / recording.name).write_text("\n".join([head, *rows[::4]]))
        return in_process(few)


@pytest.mark.timeout(600)
def test_it_is_no_cause_either_where_each_motion_was_played_once() -> None:
    """What folds into the band is noise of angles and torques alike: four joints were elastic here."""
    result = judged(Plan(11, 6464, "seven", ("base_tilt",), 0.8, 0.02, SECONDS), asked_of_few_samples)
    assert not result.wrong, result.sentence


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "plan",
    [
        Plan(3, 1212, "seven", ("joint_elasticity",), 0.4, 0.02, SECONDS),
        Plan(2, 31, "seven", ("transport_delay",), 0.4, 0.02, SECONDS),
        Plan(11, 1111, "puma600", ("torque_nonlinearity",), 0.8, 0.02, SECONDS),
        Plan(3, 6161, "seven", ("contact",), 0.4, 0.02, SECONDS),
        Plan(5, 32701, "seven", ("transmission_coupling:rotor",), 1.0, 0.02, 24.0),
        Plan(23, 35554, "puma600", ("torque_nonlinearity",), 2.0, 0.0, 60.0),
        Plan(21, 34601, "puma600", ("torque_constant_error",), 0.8, 0.0, 60.0),
        Plan(11, 35590, "puma600", ("torque_ripple",), 2.0, 0.02, 60.0),
        Plan(22, 35590, "seven", ("backlash",), 1.0, 0.0, 60.0),
    ],
    ids=lambda plan: f"{plan.kinds[0]} of {plan.size:g}",
)
def test_causes_of_geared_arms_are_named(plan: Plan) -> None:
    """A spring whose size its shape tells as well, lateness that a bent timing imitates, a law with an absent part, a
    wall that only some of the poses touch, a rotor that two joints of the wrist turn, a dead zone behind a servo that
    chatters in it, a torque constant that is no ripple of hardly a turn, a ripple of a quarter of the torque, a gap
    that is crossed in moments."""
    result = judged(plan, in_process)
    assert result.right, result.sentence


@pytest.mark.timeout(600)
@pytest.mark.parametrize(
    "plan",
    [
        Plan(20, SEED, "dda", (), 0.0, 0.03, SECONDS, friction=1.5),
        Plan(22, SEED, "dda", ("cogging",), 0.4, 0.03, SECONDS, friction=1.5),
        Plan(2, 3141, "puma600", ("torque_ripple",), 0.3, 0.05, SECONDS, friction=1.5),
        Plan(2, 14427, "seven", ("encoder_eccentricity",), 0.3, 0.0, SECONDS, friction=12.0),
    ],
    ids=lambda plan: f"{'+'.join(plan.kinds) or 'nothing'} beside {plan.friction:g} times the noise",
)
def test_what_friction_of_every_joint_hides_is_named_and_nothing_else(plan: Plan) -> None:
    result = judged(plan, in_process)
    assert result.right, result.sentence


@pytest.mark.timeout(600)
def test_bristles_under_a_servo_are_no_rise_from_rest() -> None:
    """Of twenty times the noise: what Stribeck's friction explains more there is less than what it leaves."""
    result = judged(Plan(1, 32104, "dda", ("encoder_offset",), 0.4, 0.05, 24.0, friction=20.0), in_process)
    assert not result.wrong, result.sentence


@pytest.mark.timeout(600)
def test_a_dress_pack_with_memory_is_not_taken_for_a_spring() -> None:
    result = judged(Plan(8, 1111, "puma600", ("hysteretic_spring",), 0.6, 0.02, SECONDS), in_process)
    assert result.outside_flagged, result.sentence


def test_the_form_of_a_large_friction_hides_no_cause() -> None:
    """Bristles of twenty times the noise leave as much as the cogging beside them makes, and are no unknown."""
    kinds = ("joint_spring", "link_inertia", "backlash")
    plan = Plan(9, 33504, "dda", kinds, size=1.0, scatter=0.0, seconds=24.0, friction=20.0)
    judgement = judged(plan, in_process)
    found = {cause.label: outcome for cause, outcome in zip(judgement.truth.causes, judgement.outcomes, strict=True)}
    assert found["cogging"] == "named"
    assert not judgement.wrong
    assert not judgement.flagged


def test_how_a_joint_turns_round_is_no_unknown() -> None:
    """Friction of twenty times the noise goes partly with the sign of the speed and partly with the travel."""
    result = judged(Plan(2, 34801, "dda", ("link_inertia",), 0.8, 0.02, 24.0, friction=20.0), in_process)
    assert not result.wrong, result.sentence
    assert not result.flagged, result.sentence


def test_what_fewer_forms_excuse_is_not_told_beside_more() -> None:
    """What Stribeck's friction leaves goes with the speed beside its bristles alone."""
    kinds = ("stribeck_friction", "viscous_friction")
    result = judged(Plan(9, 34303, "puma600", kinds, 1.0, 0.05, 24.0, friction=1.5), in_process)
    assert not result.flagged, result.sentence


def test_a_gap_before_a_link_that_holds_the_rotor_too_has_its_width() -> None:
    """A third of the joint's inertia is the motor's: taken for the link's, the gap is a third too narrow."""
    judgement = judged(Plan(5, 34810, "seven", ("backlash",), 1.5, 0.0, 40.0), in_process)
    assert judgement.outcomes == ("named",), judgement.sentence
    (gap,) = (p for p in judgement.parameters if p.name == "gap")
    assert abs(gap.error) < 0.1 * gap.truth


def test_two_slow_lines_of_which_neither_is_sure_of_itself_are_both_there() -> None:
    """At their best shapes either may be nearly nothing by its own error; one alone leaves the noise once more, and is
    better told as a spring."""
    judgement = judged(Plan(2, 34101, "puma600", ("cogging:pulleys",), size=0.8, scatter=0.0, seconds=60.0), in_process)
    assert judgement.outcomes == ("named",), judgement.sentence
    assert not judgement.wrong
    assert not judgement.flagged


def test_a_weak_line_that_goes_with_a_torque_or_not_is_ambiguous() -> None:
    """The torque hardly changes where the motion comes, and of ninety other lines chance lets some explain a few nats:
    those are no merit of either law."""
    judgement = judged(Plan(3, 35560, "seven", ("cogging",), size=0.2, scatter=0.05, seconds=60.0), in_process)
    assert judgement.outcomes == ("in a set",), judgement.sentence
    assert not judgement.wrong


@pytest.mark.parametrize(("number", "arm"), [(0, "puma600"), (2, "seven")])
def test_a_harmonic_drive_s_waves_are_a_line_of_their_order(number: int, arm: str) -> None:
    """Of a hundred a turn and more: the motion has them within the band where it is slow alone."""
    judgement = judged(Plan(number, 35632, arm, ("cogging:wave_generator",), 1.0, 0.0, 60.0), in_process)
    assert judgement.outcomes == ("named",), judgement.sentence
    assert not judgement.wrong
    assert not judgement.flagged
    assert max(abs(p.error) / p.truth for p in judgement.parameters) < 0.03


def test_one_joint_s_late_encoder_is_that() -> None:
    """The servo closes its loop over it, and the drive's speeds are differences of its counts."""
    judgement = judged(Plan(4, 35633, "seven", ("transport_delay:angle",), 1.0, 0.0, 60.0), in_process)
    assert judgement.outcomes == ("named",), judgement.sentence
    assert not judgement.wrong
    assert not judgement.flagged
    (delay,) = judgement.parameters
    assert abs(delay.error) < 0.1 * delay.truth


@pytest.mark.parametrize(("number", "arm"), [(1, "puma600"), (2, "seven")])
def test_grease_that_thins_as_it_is_sheared_is_viscous_friction(number: int, arm: str) -> None:
    """The stand-in's power-law fluid beside bristles: a straight law would leave a drift as good."""
    judgement = judged(Plan(number, 35640, arm, ("viscous_friction:degressive",), 40.0, 0.02, 30.0), in_process)
    assert judgement.outcomes == ("named",), judgement.sentence
    assert not judgement.wrong
    assert not judgement.flagged
