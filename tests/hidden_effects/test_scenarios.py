"""Scenarios are what they say, and what the finder is given does not tell the answer."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from benchmarks.campaign import campaign
from benchmarks.campaign.arms import ARMS, true_arm, write_urdf
from benchmarks.campaign.beyond_links import evidence_beyond_links
from benchmarks.campaign.cause import Cause, merged, named
from benchmarks.campaign.finding import in_process
from benchmarks.campaign.friction_causes import FRICTION, everywhere
from benchmarks.campaign.motions import Playlist, draw_playlist, draw_programs
from benchmarks.campaign.outside_causes import OUTSIDE
from benchmarks.campaign.plans import ALL, ASKED_FOR, CATALOGUE, Plan, draw_plans
from benchmarks.campaign.playing import Run, play
from benchmarks.campaign.scenario import Staged, mechanics, size_of, stage
from benchmarks.campaign.sealing import QUESTION, Envelope, Question, found_sealed, seal
from benchmarks.campaign.sizing import (
    BAND_HZ,
    Scale,
    amplitude_for,
    finely_counted,
    folded_rms,
    noise_in_band,
    unexplained,
)
from config.motion import check_motion
from driver.recording import read_recording
from estimator import load_rigid_body
from virtual_hw.hidden import HiddenMechanics
from virtual_hw.plant.urdf import read_urdf

SHORT = Plan(7, 3, "dda", ("coulomb_friction",), size=1.0, scatter=0.05, seconds=12.0)


@pytest.fixture(scope="module")
def staged(tmp_path_factory: pytest.TempPathFactory) -> Staged:
    folder = tmp_path_factory.mktemp("scenario") / QUESTION
    folder.mkdir()
    return stage(SHORT, folder)


@pytest.fixture(scope="module")
def sealed(staged: Staged) -> tuple[Question, Envelope]:
    return seal(staged, true_arm("dda").joints, True, staged.urdf.parent.parent)


@pytest.mark.parametrize("arm", ARMS)
def test_every_cause_is_one_that_the_stand_in_knows(arm: str) -> None:
    the_arm, rng = true_arm(arm), np.random.default_rng(1)
    drawn = [draw(the_arm, joint, rng) for draw in ALL.values() for joint in the_arm.joints]
    causes = [cause for cause in drawn if cause is not None]
    assert {cause.label.partition(":")[0] for cause in causes} >= {name.partition(":")[0] for name in CATALOGUE}
    assert {cause.label for cause in causes if cause.outside} == set(OUTSIDE)
    for cause in causes:
        for amplitude in (cause.start, cause.limit):
            mechanics(the_arm, [cause], [cause.tables(amplitude)])


def test_right_answers_are_names_of_the_catalogue() -> None:
    from estimator.effects import catalogue

    the_arm, rng = true_arm("seven"), np.random.default_rng(1)
    causes = [draw(the_arm, joint, rng) for draw in CATALOGUE.values() for joint in the_arm.joints]
    named = {effect for cause in causes if cause is not None for effect, _ in cause.answers}
    assert named <= set(catalogue())


@pytest.mark.parametrize("draw", [draw_playlist, draw_programs])
@pytest.mark.parametrize("arm", ARMS)
def test_motions_keep_the_arms_limits_and_meet_at_home(arm: str, draw: Callable[..., Playlist]) -> None:
    installation = true_arm(arm).installation
    playlist = draw(installation, np.random.default_rng(2), 60.0)
    for motion in playlist.motions.values():
        check_motion(motion, installation)
        np.testing.assert_allclose(motion.q[[0, -1]], [installation.arm.home_rad] * 2, atol=1e-6)
    assert all(playlist.order.count(name) == 2 for name in playlist.motions)


@pytest.mark.parametrize("arm", ARMS)
def test_a_clean_arm_is_explained_by_its_bodies_far_below_the_noise(arm: str) -> None:
    """By fast sweeps too, whose torques reach beyond the band that sizes are told in."""
    true = true_arm(arm)
    playlist = draw_playlist(true.installation, np.random.default_rng([3333, 6, 1]), 24.0)
    clean = mechanics(true, [], [])
    runs = play(finely_counted(true.installation), clean, replace(playlist, order=("a", "b", "c")), seed=0)
    noise = noise_in_band([sensor.noise for sensor in true.noise.torque_sensor], seed=0)
    assert np.all(unexplained(runs, true.installation, clean) < 0.1 * noise)


def test_the_effect_has_the_wanted_size(staged: Staged) -> None:
    (cause,) = staged.truth.causes
    assert cause.size == pytest.approx(SHORT.size, rel=0.02)
    assert cause.parameters == {"level": cause.amplitude}


@pytest.mark.parametrize("arm", ARMS)
def test_friction_of_every_joint_stands_beside_the_causes_and_has_its_names(arm: str) -> None:
    the_arm, level = true_arm(arm), np.linspace(0.1, 0.5, len(true_arm(arm).joints))
    tables, names = everywhere(the_arm, level, np.random.default_rng(4))
    second = the_arm.joints[1]
    rough = FRICTION["stribeck_friction"](the_arm, second, np.random.default_rng(4))
    assert rough is not None
    hidden = mechanics(the_arm, [rough], [tables, rough.tables(0.3)])
    assert [entry.joint for entry in hidden.friction] == list(the_arm.joints)
    for entry, about in zip(hidden.friction, level, strict=True):
        own = entry.joint != second
        assert not own or 0.5 * about < entry.level_nm < 1.6 * about
        assert own or entry.level_nm == 0.3
        assert (entry.breakaway_factor == 1.0) is own
        assert entry.viscous_nms_rad > 0.0
    assert ("coulomb_friction", second) in names
    assert not {effect for effect, _ in names} & {"stribeck_friction", "asymmetric_friction", "friction_drift"}


def test_a_swinging_load_is_as_large_as_what_a_still_one_does_not_explain() -> None:
    the_arm = true_arm("dda")
    swings = OUTSIDE["sloshing_load"](the_arm, "joint3", np.random.default_rng(1))
    assert swings is not None
    playlist = draw_playlist(the_arm.installation, np.random.default_rng(2), 12.0)
    clean = mechanics(the_arm, [], [])
    scale = Scale(the_arm.installation, playlist, clean, np.ones(3))
    whole = scale.size(mechanics(the_arm, [swings], [swings.tables(1.0)]))
    beside = replace(scale, clean=mechanics(the_arm, [], [swings.known(1.0)]))
    still = beside.size(mechanics(the_arm, [], [swings.known(1.0)]))
    assert still < 0.02 * whole
    assert 0.1 * whole < size_of(the_arm, scale, swings, 1.0) < 0.9 * whole
    assert ("payload", None) in swings.excused


@pytest.mark.parametrize(("kind", "amplitude", "told"), [("payload", 0.02, False), ("torque_offset", 0.1, True)])
def test_what_links_within_their_tolerance_may_be_holds_no_evidence(
    kind: str, amplitude: float, told: bool, tmp_path: Path
) -> None:
    """A load of 20 g against a body of links that are off by five per cent; and against one that is exact."""
    the_arm = true_arm("dda")
    cause = ALL[kind](the_arm, "joint3", np.random.default_rng(1))
    assert cause is not None
    playlist = draw_playlist(the_arm.installation, np.random.default_rng(2), 12.0)
    scale = Scale(the_arm.installation, playlist, mechanics(the_arm, [], []), np.ones(3))
    hidden = mechanics(the_arm, [cause], [cause.tables(amplitude)])
    write_urdf(the_arm, dict(the_arm.bodies), urdf := tmp_path / "arm.urdf")
    body = load_rigid_body(urdf.read_text())
    noise = noise_in_band([sensor.noise for sensor in the_arm.noise.torque_sensor], seed=0)
    loose, exact = (evidence_beyond_links(scale, hidden, body, noise, share) for share in (0.05, 1e-9))
    # The torque's mean square below the band, in as many independent rows as that holds in two playings.
    rms = unexplained(scale.played(hidden), the_arm.installation, scale.clean)
    seconds = 2.0 * sum(m.duration_s for name, m in playlist.motions.items() if not name.startswith("held-out"))
    assert exact == pytest.approx(0.5 * 2.0 * BAND_HZ * seconds * float(np.sum((rms / noise) ** 2)), rel=0.15)
    assert exact > 20.0
    assert (loose > 20.0) == told
    assert loose < exact


def test_what_the_plant_cannot_step_or_the_arm_not_bear_is_not_staged() -> None:
    cause = Cause("elastic", named("joint_elasticity", "joint1"), lambda a: {}, start=1.0, limit=4.0, least=0.1)
    assert amplitude_for(cause, 1.0, lambda a: a / 2.0) == (2.0, 1.0)
    asked: list[float] = []

    def too_large(amplitude: float) -> float:
        asked.append(amplitude)
        return 1000.0 * amplitude

    assert amplitude_for(cause, 1.0, too_large) is None
    assert min(asked) == cause.least
    assert amplitude_for(cause, 1.0, lambda a: 0.01 * a) is None


def test_noise_as_recorded_is_the_sensors_and_what_folds_into_the_band() -> None:
    random, rate, rows = np.random.default_rng(0), 1000, 40_000
    slow = np.sin(2 * np.pi * 0.5 * np.arange(rows) / rate)[:, None] * np.array([30.0, 5.0])
    chatter = random.normal(size=(rows, 2)) * np.array([2.0, 0.0])
    still = np.zeros((rows, 2))
    folded = folded_rms([Run("a", np.arange(rows) / rate, still, still, slow + chatter)], 4)
    # Of four samples one is kept: of the white noise's density, three quarters come from above.
    expected = 2.0 * np.sqrt(BAND_HZ / (rate / 8) * 0.75) * 1.05
    assert folded[0] == pytest.approx(expected, rel=0.15)
    assert folded[1] < 1e-3


def test_the_same_plan_gives_the_same_recordings(staged: Staged, tmp_path: Path) -> None:
    again = stage(SHORT, tmp_path)
    assert again.truth == staged.truth
    for run, before in zip(again.runs, staged.runs, strict=True):
        np.testing.assert_array_equal(run.tau, before.tau)


def test_the_urdf_that_is_handed_over_misses_the_true_bodies_by_no_more_than_the_scatter(staged: Staged) -> None:
    given, truth = read_urdf(staged.urdf).bodies, true_arm("dda").bodies
    misses = [given[link].mass / body.mass - 1.0 for link, body in truth.items() if body.mass > 0.0]
    assert 0.0 < max(map(abs, misses)) <= SHORT.scatter


def test_torques_come_in_the_drives_own_grain_and_stamps_jitter(staged: Staged) -> None:
    rated = np.array([j.rated_torque_nm for j in true_arm("dda").installation.joint])
    grains = staged.runs[0].tau / rated * 1000.0
    np.testing.assert_allclose(grains, np.round(grains), atol=1e-6)
    assert all(np.all(np.diff(run.t) > 0.0) for run in staged.runs)


def test_the_finder_reads_what_was_recorded_and_nothing_of_the_answer(
    staged: Staged, sealed: tuple[Question, Envelope]
) -> None:
    question, envelope = sealed
    assert (len(question.learnt), len(question.held_out)) == (6, 2)
    recording = read_recording(question.learnt[0])
    np.testing.assert_allclose(recording.tau, staged.runs[0].tau, rtol=1e-8)
    assert not envelope.path.is_relative_to(question.folder)
    told = "".join(path.name + path.read_text() for path in (*question.learnt, *question.held_out, question.urdf))
    assert not any(label.partition(":")[0] in told for label in ALL)


def test_an_envelope_gives_back_what_was_put_in(staged: Staged, sealed: tuple[Question, Envelope]) -> None:
    assert sealed[1].open() == staged.truth


def test_a_kept_scenario_is_found_again(sealed: tuple[Question, Envelope], tmp_path: Path) -> None:
    assert found_sealed(sealed[0].folder.parent) == sealed
    assert found_sealed(tmp_path) is None


def test_a_scenario_that_was_cut_off_is_staged_anew(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    left = tmp_path / SHORT.name / QUESTION / "arm.urdf"
    left.parent.mkdir(parents=True)
    left.touch()
    monkeypatch.setattr(campaign, "stage", cut_off)
    for _ in range(2):
        with pytest.raises(KeyboardInterrupt):
            campaign.judged(SHORT, in_process, kept=tmp_path)
    assert not left.exists()


def cut_off(plan: Plan, folder: Path) -> Staged:
    raise KeyboardInterrupt


def test_an_envelope_that_was_changed_is_not_believed(staged: Staged, tmp_path: Path) -> None:
    envelope = Envelope.close(staged.truth, tmp_path / "truth.json")
    answer = json.loads(envelope.path.read_text())
    answer["causes"][0]["amplitude"] *= 2
    envelope.path.write_text(json.dumps(answer))
    with pytest.raises(ValueError, match="changed after it was closed"):
        envelope.open()


def test_plans_give_each_kind_its_turn() -> None:
    plans = draw_plans(200, seed=1)
    kinds = [kind for plan in plans for kind in plan.kinds]
    assert sum(not plan.kinds for plan in plans) == 40
    assert {plan.arm for plan in plans} == set(ARMS)
    assert set(kinds) == set(ALL) - set(ASKED_FOR)
    assert {plan.size for plan in plans if len(plan.kinds) == 1} == {0.2, 0.4, 0.8, 1.0, 2.0, 1.5}
    assert draw_plans(200, seed=1) == plans


def test_tables_of_one_joint_are_put_together() -> None:
    parts = [
        {"torque_sensor": [{"joint": "a", "noise": {"white": 1.0}}], "cogging": [{"joint": "a", "order": 1}]},
        {"torque_sensor": [{"joint": "a", "offset_nm": 2.0}], "cogging": [{"joint": "a", "order": 2}]},
    ]
    whole = merged(parts)
    assert whole["torque_sensor"] == [{"joint": "a", "noise": {"white": 1.0}, "offset_nm": 2.0}]
    assert [entry["order"] for entry in whole["cogging"]] == [1, 2]
    assert parts[0]["torque_sensor"] == [{"joint": "a", "noise": {"white": 1.0}}]


def test_hidden_mechanics_of_a_clean_arm_differ_by_bodies_alone() -> None:
    clean = mechanics(true_arm("puma600"), [], [])
    assert clean.friction == HiddenMechanics().friction
    assert len(clean.link) == 6
