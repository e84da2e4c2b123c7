"""Judging and tallying, by finders that are right, wrong, careful and silent on purpose."""

from __future__ import annotations

from dataclasses import replace
from typing import Any

import pytest

from benchmarks.campaign.judging import Judgement, judge
from benchmarks.campaign.scenario import TrueCause, Truth
from benchmarks.campaign.tally import CampaignFigure, mistaken, tally, wilson

COULOMB = TrueCause(
    "coulomb_friction", frozenset({("coulomb_friction", "joint2")}), frozenset(), 1.5, 1.0, {"level": 1.5}
)
PAYLOAD = TrueCause(
    "payload", frozenset({("payload", None), ("link_inertia", "link6")}), frozenset(), 0.7, 0.5, {"mass": 0.7}
)
WOBBLE = TrueCause("pulley_wobble", frozenset(), frozenset({("cogging", "joint1")}), 0.3, 0.9, {})
CLEAN = Truth(0, "puma600", 0.05, ())


def true(*causes: TrueCause, number: int = 1) -> Truth:
    return Truth(number, "puma600", 0.05, causes)


def finding(
    effect: str,
    joint: str | None,
    status: str = "named",
    others: tuple[tuple[str, str | None], ...] = (),
    nats: float = 10.0,
    **parameters: tuple[float, float],
) -> dict[str, Any]:
    return {
        "effect": effect,
        "joint": joint,
        "status": status,
        "evidence": {"log_likelihood_gain": nats},
        "parameters": {
            name: {"value": value, "standard_error": error, "unit": "N·m"}
            for name, (value, error) in parameters.items()
        },
        "alternatives": [{"effect": e, "joint": j, "log_likelihood_gap": 1.0} for e, j in others],
    }


def answer(
    verdict: str, *findings: dict[str, Any], unexplained: tuple[str, ...] = (), gain: float = 0.9
) -> dict[str, Any]:
    return {
        "verdict": verdict,
        "findings": list(findings),
        "unexplained": {joint: {"share": 0.5, "signature": "with q"} for joint in unexplained},
        "gain": {"held_out_torque": {"before_rms": 1.0, "after_rms": 0.5, "share_of_explainable": gain}},
    }


def figure(judged: list[Judgement], name: str) -> CampaignFigure:
    return next(f for f in tally(judged) if f.name.startswith(name))


def test_a_right_name_on_the_right_joint_is_right() -> None:
    j = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint2", level=(1.6, 0.1))), 0.5)
    assert j.right
    assert j.outcomes == ("named",)
    assert not j.wrong
    (error,) = j.parameters
    assert (error.name, error.error, error.standard_error) == ("level", pytest.approx(0.1), 0.1)


def test_what_nobody_could_tell_is_tallied_apart() -> None:
    """A cause that links within their tolerance may be, missed, beside one that they cannot be, named."""
    named = answer("named", finding("coulomb_friction", "joint2"))
    judged = [
        judge(replace(true(COULOMB), evidence=nats), said, 0.5)
        for nats, said in ((50.0, named), (0.2, answer("clean")), (None, named))
    ]
    of_all, of_told = (f for f in tally(judged) if f.count and f.name.startswith("effect and joint right, "))
    assert (of_all.value, of_all.count) == (pytest.approx(2 / 3), 3)
    assert (of_told.value, of_told.count) == (1.0, 1)


def test_sets_of_what_the_catalogue_has_not_are_tallied_apart() -> None:
    """No set of names can hold a cause that has none."""
    said = answer("ambiguous", finding("coulomb_friction", "joint2", "ambiguous", (("presliding", "joint2"),)))
    judged = [judge(truth, said, 0.5) for truth in (true(COULOMB), true(WOBBLE))]
    assert figure(judged, "ambiguous sets that hold").value == 0.5
    told = figure(judged, "ambiguous sets where the catalogue has all of it")
    assert (told.value, told.count) == (1.0, 1)


def test_the_right_name_on_another_joint_is_wrong() -> None:
    j = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint3")), 0.5)
    assert not j.right
    assert j.wrong == (("coulomb_friction", "joint3"),)
    assert j.outcomes == ("missed",)
    assert j.parameters == ()


def test_names_that_mean_the_same_thing_leave_nothing_to_decide() -> None:
    same = answer("ambiguous", finding("payload", None, "ambiguous", (("link_inertia", "link6"),)))
    assert judge(true(PAYLOAD), same, 0.5).right
    other = answer("ambiguous", finding("payload", None, "ambiguous", (("encoder_offset", "joint6"),)))
    assert judge(true(PAYLOAD), other, 0.5).outcomes == ("in a set",)


def test_a_second_name_that_is_not_there_spoils_a_right_one() -> None:
    j = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint2"), finding("backlash", "joint1")), 0.5)
    assert j.outcomes == ("named",)
    assert not j.right


def test_what_is_excused_of_a_scenario_is_not_wrong_on_a_clean_arm_either() -> None:
    excused = Truth(0, "puma600", 0.05, (), frozenset({("transport_delay", None)}))
    late = answer("named", finding("transport_delay", None))
    assert not judge(excused, late, 0.5).wrong
    assert figure([judge(excused, late, 0.5)], "false alarms").value == 0.0
    assert figure([judge(CLEAN, late, 0.5)], "false alarms").value == 1.0
    unsure = answer("ambiguous", finding("backlash", None, "ambiguous", (("transport_delay", None),)))
    assert figure([judge(excused, unsure, 0.5)], "false alarms").value == 0.0
    assert figure([judge(CLEAN, unsure, 0.5)], "false alarms").value == 1.0


def test_an_ambiguous_finding_is_neither_right_nor_wrong_and_holds_what_its_alternatives_hold() -> None:
    careful = finding("presliding", "joint2", "ambiguous", (("backlash", "joint2"), ("coulomb_friction", "joint2")))
    j = judge(true(COULOMB), answer("ambiguous", careful), 0.5)
    assert not j.right
    assert not j.wrong
    assert j.outcomes == ("in a set",)
    assert [(s.size, s.holds) for s in j.sets] == [(3, True)]
    missed = judge(true(PAYLOAD), answer("ambiguous", careful), 0.5)
    assert [s.holds for s in missed.sets] == [False]


def test_alternatives_of_a_named_finding_do_not_help_it() -> None:
    j = judge(
        true(COULOMB), answer("named", finding("backlash", "joint2", "named", (("coulomb_friction", "joint2"),))), 0.5
    )
    assert j.outcomes == ("missed",)
    assert j.wrong == (("backlash", "joint2"),)


def test_what_is_one_and_the_same_thing_may_have_either_name_but_only_its_own_parameters_are_compared() -> None:
    j = judge(true(PAYLOAD), answer("named", finding("link_inertia", "link6", mass=(3.0, 0.1))), 0.5)
    assert j.right
    assert j.parameters == ()


@pytest.mark.parametrize(
    ("given", "flagged", "wrong"),
    [
        (answer("unknown", unexplained=("joint1",)), True, ()),
        (answer("named", finding("cogging", "joint1"), unexplained=("joint1",)), True, ()),
        (answer("named", finding("cogging", "joint1")), False, ()),
        (answer("named", finding("joint_spring", "joint1")), False, (("joint_spring", "joint1"),)),
        (answer("clean"), False, ()),
    ],
)
def test_an_outside_effect_is_to_be_flagged(given: dict[str, Any], flagged: bool, wrong: tuple[Any, ...]) -> None:
    j = judge(true(WOBBLE), given, 0.5)
    assert j.outside_flagged is flagged
    assert j.wrong == wrong


def test_false_alarms_are_counted_family_wise() -> None:
    judged = [judge(CLEAN, answer("clean"), 0.5) for _ in range(9)]
    judged.append(judge(CLEAN, answer("unknown", unexplained=("joint1",)), 0.5))
    alarms = figure(judged, "false alarms")
    assert (alarms.value, alarms.count, alarms.reached) == (pytest.approx(0.1), 10, False)
    assert figure(judged[:9], "false alarms").reached is True


def test_what_is_flagged_beside_names_is_an_alarm_on_a_clean_arm_too() -> None:
    rubs = Truth(0, "puma600", 0.05, (), frozenset({("coulomb_friction", "joint1")}))
    named = finding("coulomb_friction", "joint1")
    flagged = [
        judge(rubs, answer("named", named, unexplained=("joint2",)), 0.5),
        judge(rubs, answer("named", named), 0.5),
    ]
    assert figure(flagged, "false alarms").value == 0.5
    outside = judge(true(WOBBLE), answer("unknown", unexplained=("joint1",)), 0.5)
    said = figure([*flagged, outside], "flagged unknown where")
    assert (said.value, said.count) == (0.5, 2)


def test_sizes_are_tallied_apart() -> None:
    right = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint2")), 0.5)
    silent = judge(true(PAYLOAD), answer("clean"), 0.5)
    assert figure([right, silent], "effect and joint right, effect/noise 0.9").value == 1.0
    assert figure([right, silent], "effect and joint right, effect/noise 0.3").value == 0.0
    assert figure([right, silent], "effect and joint right, effect/noise 0 ").count == 0


def test_confidently_wrong_counts_scenarios_not_names_and_lists_what_was_taken_for_what() -> None:
    wrong = judge(true(COULOMB), answer("named", finding("backlash", "joint1"), finding("backlash", "joint2")), 0.5)
    silent = judge(true(COULOMB), answer("clean"), 0.5)
    assert figure([wrong, silent], "confidently wrong").value == 0.5
    assert mistaken([wrong, silent]) == [("coulomb_friction", "backlash", 2)]
    assert figure([silent], "confidently wrong").reached is True


def test_each_of_several_causes_counts() -> None:
    both = judge(true(COULOMB, PAYLOAD), answer("named", finding("payload", None)), 0.5)
    assert figure([both], "each of several").value == 0.5


def test_the_gain_is_a_mean_over_scenarios_with_causes_of_the_catalogue() -> None:
    much = judge(true(COULOMB), answer("named", gain=0.9), 0.5)
    little = judge(true(COULOMB), answer("clean", gain=0.2), 0.5)
    nothing_to_gain = judge(CLEAN, answer("clean", gain=0.0), 0.5)
    outside = judge(true(WOBBLE), answer("unknown", gain=0.0), 0.5)
    gain = figure([much, little, nothing_to_gain, outside], "held-out gain")
    assert (gain.value, gain.count, gain.reached) == (pytest.approx(0.55), 2, False)


def test_intervals_of_parameters_are_checked_against_the_truth() -> None:
    near = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint2", level=(1.6, 0.1))), 0.5)
    far = judge(true(COULOMB), answer("named", finding("coulomb_friction", "joint2", level=(1.8, 0.1))), 0.5)
    assert figure([near, far], "parameters within").value == 0.5


def test_of_several_lines_the_strongest_is_compared() -> None:
    ripple = TrueCause("torque_ripple", frozenset({("torque_ripple", "joint2")}), frozenset(), 1.0, 1.0, {"order": 5.0})
    strong = finding("torque_ripple", "joint2", nats=900.0, order=(5.01, 0.01))
    (error,) = judge(
        true(ripple), answer("named", finding("torque_ripple", "joint2", order=(10.0, 0.1)), strong), 1.0
    ).parameters
    assert error.error == pytest.approx(0.01)


def test_a_figure_without_cases_reaches_nothing_and_misses_nothing() -> None:
    assert all(f.reached is None for f in tally([]) if f.goal is not None)


def test_wilson_interval_of_known_values() -> None:
    """Newcombe 1998, table I: 81 of 263 gives 0.2553 to 0.3662; 0 of 20 gives 0 to 0.1611."""
    assert wilson(81, 263) == (pytest.approx(0.2553, abs=1e-4), pytest.approx(0.3662, abs=1e-4))
    assert wilson(0, 20) == (0.0, pytest.approx(0.1611, abs=1e-4))
    assert wilson(0, 0) == (0.0, 1.0)
