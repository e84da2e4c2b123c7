"""Practice as the service does it: certificates, refusals, what is kept, and a session through the stand-in arm."""

from __future__ import annotations

import csv
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from numpy.typing import NDArray

from config import InputError, load_installation
from driver.recording import Recording, read_recording
from learner.trial import Reference
from service import outcomes
from service.cli.entry import run
from service.practice.controllers import variants
from service.practice.inverse_models import load_inverse_model
from service.practice.planning import practised_motion
from service.practice.record import read_feedforward, write_feedforward
from service.practice.trials import actuation_lag, as_demanded, trial_of
from service.reports import pages

Array = NDArray[np.float64]
pytestmark = pytest.mark.timeout(600)
SHORT = """
kind = "polynomial"
way_points_rad = [[3.58, 2.69, 1.75], [3.0, 2.2, 1.2]]
duration_s = [0.6]
"""


@pytest.fixture
def short(tmp_path: Path) -> str:
    path = tmp_path / "short.toml"
    path.write_text(SHORT)
    return str(path)


def said(capsys: pytest.CaptureFixture[str]) -> str:
    """The one sentence on standard error."""
    sentences = [line for line in capsys.readouterr().err.splitlines() if line.startswith("etude: ")]
    assert len(sentences) == 1
    return sentences[0]


def test_a_certificate_needs_no_daemon(house: Any, tmp_path: Path) -> None:
    target = tmp_path / "certificate.json"
    assert run(["certify", "dda-practice", "--json", str(target)]) == outcomes.DONE
    answer = json.loads(target.read_text())
    assert answer["verdict"] == "converges"
    assert answer["learning_bandwidth"] > 40.0
    assert 0.0 < answer["expected_error_ratio"] < 0.1
    assert {"frequency", "spectral_radius"} == set(answer["gain"][0])


def test_a_refused_operator_is_the_answer_no(house: Any, tmp_path: Path) -> None:
    """One inertia a joint cannot learn a motion of which the servo corrects nothing by itself."""
    config = house.arm_files()
    text = config.read_text()
    for joint in load_installation(str(config)).joint:
        servo = joint.servo
        text = text.replace(
            f"servo = {{ stiffness_nm_rad = {servo.stiffness_nm_rad:g}, damping_nms_rad = {servo.damping_nms_rad:g} }}",
            f"servo = {{ stiffness_nm_rad = {servo.stiffness_nm_rad / 400:g}, "
            f"damping_nms_rad = {servo.damping_nms_rad / 20:g} }}",
        )
    config.write_text(text)
    target = tmp_path / "certificate.json"
    arguments = ["certify", "dda-practice", "--arm", str(config), "--operator", "proportional", "--json", str(target)]
    assert run(arguments) == outcomes.ANSWER_IS_NO
    answer = json.loads(target.read_text())
    assert answer["verdict"] == "refused"
    assert answer["learning_bandwidth"] < answer["motion_band"]
    assert "Hz" in answer["reason"]


@pytest.mark.parametrize(("arm", "motion"), [("puma600", "puma600-load"), ("seven", "seven-identify-1")])
def test_a_model_that_lacks_the_rotors_certifies_nothing(arm: str, motion: str, house: Any, tmp_path: Path) -> None:
    """Geared arms by their URDF: links so light that the arm's own servo would shake them."""
    target = tmp_path / "certificate.json"
    assert run(["certify", motion, "--arm", arm, "--json", str(target)]) == outcomes.ANSWER_IS_NO
    answer = json.loads(target.read_text())
    assert answer["verdict"] == "refused"
    assert answer["finite_interval"] == {"norm": None, "eigenvalue": None}
    assert "rotors" in answer["reason"]


def test_a_motion_outside_the_limits_is_named(house: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    fast = tmp_path / "fast.toml"
    fast.write_text(SHORT.replace("0.6", "0.2"))
    assert run(["certify", str(fast), "--arm", "dda"]) == outcomes.BAD_INPUT
    sentence = said(capsys)
    assert "joint1: acceleration" in sentence
    assert "it fits when played in" in sentence


def test_a_model_of_another_arm_is_refused(house: Any, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    from estimator.arm_model import ArmModel
    from service.identification.arm_source import of_installation
    from service.models.model_file import model_file, write_model

    puma = load_installation("puma600")
    body = of_installation(puma).rigid_body(puma.joint_names, {})
    path = tmp_path / "puma.toml"
    write_model(path, model_file("puma600", ArmModel(body), "made for a test", ()))
    assert run(["certify", "dda-practice", "--arm", "dda", "--model", str(path)]) == outcomes.BAD_INPUT
    assert "is a model of arm puma600" in said(capsys)


def test_feedforward_comes_back_to_the_last_digit(tmp_path: Path) -> None:
    torque = np.random.default_rng(3).normal(size=(40, 2))
    path = tmp_path / "feedforward.csv"
    write_feedforward(path, torque, 1e-3, ("a", "b"))
    np.testing.assert_array_equal(read_feedforward(path, ("a", "b"), 40), torque)
    with pytest.raises(InputError, match="40 samples and the motion 41"):
        read_feedforward(path, ("a", "b"), 41)
    with pytest.raises(InputError, match="line 1"):
        read_feedforward(path, ("a", "c"), 40)
    rows = list(csv.reader(path.read_text().splitlines()))
    rows[7][1] = "x"
    path.write_text("\n".join(",".join(row) for row in rows))
    with pytest.raises(InputError, match="line 8"):
        read_feedforward(path, ("a", "b"), 40)


def recorded(reference: Reference, loop: Any, lag: int) -> Recording:
    """A run in CSP of an arm that is always 1 mrad behind and whose torque is measured ``lag`` cycles late."""
    ends = ((300, 400), (0, 0))
    q_d, dq_d = np.pad(reference.q, ends, mode="edge"), np.pad(reference.dq, ends)
    command = 5.0 * np.sin(np.arange(len(q_d)) / 40.0)[:, None] * np.ones(reference.n)
    wobble = 1e-3 * np.cos(np.arange(len(q_d)) / 25.0)[:, None]
    q, dq = np.roll(q_d, 2, axis=0) + wobble, np.roll(dq_d, 2, axis=0)
    demand = np.roll(command, 2, axis=0) - loop.stiffness * wobble
    return Recording(
        Path("run.mcap"), ("joint1", "joint2", "joint3"), 0, np.arange(len(q)) / 1000.0, q, dq,
        np.roll(demand, lag, axis=0), q_d, dq_d, command,
    )  # fmt: skip


def test_trials_are_found_and_lags_identified() -> None:
    practised = practised_motion("dda-practice", load_installation("dda"), "csp")
    reference = practised.reference
    recording = recorded(reference, practised.loop, 3)
    trial = trial_of(recording, reference, practised.command_delay, "run")
    assert np.abs(trial.q - reference.q).max() < 1.001e-3
    np.testing.assert_array_equal(trial.dq, reference.dq)
    holed = recording.dq.copy() if recording.dq is not None else recording.q
    holed[700:703, 1] = np.nan
    bridged = trial_of(replace(recording, dq=holed), reference, practised.command_delay, "run")
    np.testing.assert_allclose(bridged.dq, trial.dq, atol=1e-3)
    holed[900:910, 2] = np.nan
    with pytest.raises(InputError, match="joint number 3 is missing"):
        trial_of(replace(recording, dq=holed), reference, practised.command_delay, "run")
    commanded = recording.q_d
    assert commanded is not None
    lag = actuation_lag([recording], practised.loop, reference, "csp")
    np.testing.assert_allclose(lag.cycles, 3.0, atol=0.13)
    only_first = np.array([True, False, False])
    assert recording.tau is not None
    chatter = replace(recording, tau=recording.tau + np.random.default_rng(2).normal(size=recording.q.shape))
    seen = trial_of(chatter, reference, practised.command_delay, "run")
    demanded = as_demanded(seen, chatter, reference, practised.loop, "csp", np.full(3, 3.0), only_first)
    np.testing.assert_allclose(demanded.tau[3:, 0], trial.tau[3:, 0], atol=1e-9)
    np.testing.assert_array_equal(demanded.tau[:, 1:], seen.tau[:, 1:])
    with pytest.raises(InputError, match="does not hold the whole motion"):
        trial_of(replace(recording, q_d=commanded[:1500]), reference, 2, "run")


def test_a_motion_is_re_timed_to_the_arms_limits(house: Any, tmp_path: Path) -> None:
    fast, target = tmp_path / "fast.toml", tmp_path / "answer.json"
    assert run(["retime", "dda-practice", "--arm", "dda", "--out", str(fast), "--json", str(target)]) == outcomes.DONE
    answer = json.loads(target.read_text())
    assert answer["duration_s"] < 0.8 * answer["duration_before_s"]
    assert max(answer["largest_share_of_torque_limit"].values()) < 1.0
    # What it wrote is a motion of this arm, and practice may begin with it.
    assert run(["certify", str(fast), "--arm", "dda"]) == outcomes.DONE
    assert (
        run(["retime", "dda-practice", "--arm", "dda", "--out", str(fast), "--angle-error", "9"]) == outcomes.BAD_INPUT
    )


def test_controllers_of_appendix_a() -> None:
    from config.motion import load_motion, sample

    installation = load_installation("dda")
    motion = sample(load_motion("dda-controllers", installation), 1000.0)
    found = variants(motion, load_inverse_model(None, installation), None, installation)
    assert [v.family for v in found] == ["hybrid"] * 5 + ["digital"] * 6
    assert {v.rate_hz for v in found if v.family == "digital"} == {133.0, 1000.0}
    assert [v.within(installation) for v in found] == [False] * 2 + [True] * 9
    assert np.rad2deg(np.abs(found[0].lag).max(axis=0)) == pytest.approx([19.1, 19.1, 19.1], abs=0.8)
    assert not found[0].plan.arrays[1].any()
    assert not found[2].plan.arrays[3].any()
    still = found[3].plan.arrays[3]
    assert np.abs(found[4].plan.arrays[3] - still).max() > 50.0


def test_practice_through_the_arm_is_stopped_taken_up_and_played(running_house: Any, short: str) -> None:
    house = running_house
    client = house.popen("practise", short, "--trials", "1")
    assert client.stderr is not None
    for line in client.stderr:
        if line.startswith("replay 2"):
            break
    house.etude("stop")
    client.communicate(timeout=60)
    assert client.returncode == outcomes.ARM_STOPPED
    assert house.answer("reset")["state"] == "idle"
    session = house.answer("report", "last")["id"]
    answer = house.answer("practise", short, "--trials", "1", "--resume", session)
    kinds = [Path(path).stem.split("-")[-2] for path in answer["recordings"]]
    assert kinds.count("replay") == 5
    assert session in answer["recordings"][0]
    assert session not in answer["recordings"][-1]
    trials = answer["trials"]
    assert len(trials) == 2
    for joint, floor in answer["repeatability"].items():
        first, last = (t["velocity_error_rms"][joint] for t in (trials[0], trials[-1]))
        assert last < 1.05 * first
        assert last < 2.0 * floor
    assert answer["certificate"]["verdict"] == "converges"
    assert set(answer["actuation_lag_cycles"]) == {"joint1", "joint2", "joint3"}
    assert Path(answer["plot"]).stat().st_size > 10_000
    report = house.answer("report", "last")
    assert report["result"]["stopped_because"] == answer["stopped_because"]
    page = pages.page_of(report["result"], Path(report["directory"]))
    assert page is not None
    assert "× repeatability" in page
    other = house.etude("practise", "dda-practice", "--resume", answer["session"])
    assert other.returncode == outcomes.BAD_INPUT
    assert "practised" in other.stderr
    played = house.answer("run", short, "--feedforward", answer["feedforward"])
    assert max(e["position_peak"] for e in played["tracking_error"].values()) < 0.05
    assert read_recording(played["recording"]).tau_ff is not None
    # What the session taught serves the same motion as well, and one nearby.
    near = Path(short).with_name("near.toml")
    near.write_text(SHORT.replace("3.0, 2.2, 1.2", "3.05, 2.15, 1.15"))
    for motion in (short, str(near)):
        taught = house.answer("run", motion, "--feedforward", answer["session"])
        for joint, error in taught["tracking_error"].items():
            assert error["position_peak"] < 1.2 * played["tracking_error"][joint]["position_peak"] + 1e-3


def test_practice_with_the_controller_in_the_loop(running_house: Any, short: str) -> None:
    """Torque mode: no servo in the drive, feedback two cycles sooner than in CSP, feedforward sent ahead."""
    answer = running_house.answer("practise", short, "--mode", "cst", "--trials", "1")
    first, last = (trial["velocity_error_rms"] for trial in answer["trials"])
    assert answer["mode"] == "cst"
    floor = answer["repeatability"]
    begun, come = (max(trial[joint] / floor[joint] for joint in floor) for trial in (first, last))
    assert come < 0.8 * begun
    assert all(last[joint] < 1.05 * first[joint] for joint in floor)
    taken = running_house.etude("run", short, "--feedforward", answer["session"])
    assert taken.returncode == outcomes.BAD_INPUT
    assert "add --mode cst" in taken.stderr


def test_controllers_are_compared_through_the_arm(running_house: Any, tmp_path: Path) -> None:
    """There and back, so that no time goes into returning: Appendix A's controllers at both rates, in its order."""
    path = tmp_path / "there-and-back.toml"
    path.write_text(
        'kind = "polynomial"\n'
        "way_points_rad = [[3.58, 2.69, 1.75], [3.46, 2.57, 1.6], [3.58, 2.69, 1.75]]\nduration_s = [0.26, 0.26]\n"
    )
    target = tmp_path / "answer.json"
    # Eleven motions on a busy machine take longer than a command is waited for.
    client = running_house.popen("compare-controllers", str(path), "--json", str(target))
    _, told = client.communicate(timeout=580)
    assert client.returncode == outcomes.DONE, told
    answer = json.loads(target.read_text())
    rows = {(r["family"], r["controller"], r["rate_hz"]): r for r in answer["controllers"]}
    assert len(rows) == 11
    assert all(row["played"] for row in rows.values())
    session = Path(answer["plot"]).parent
    assert len(list(session.glob("*.mcap"))) == 11
    assert Path(answer["plot"]).stat().st_size > 10_000

    def peaks(*key: object) -> dict[str, float]:
        found: dict[str, float] = rows[key]["peak_deg"]  # type: ignore[index]
        return found

    told_nothing = peaks("hybrid", "position reference", 1000.0)
    told_velocity = peaks("hybrid", "position and velocity reference", 1000.0)
    told_torque = peaks("hybrid", "full dynamics", 1000.0)
    for joint in ("joint1", "joint2", "joint3"):
        assert told_torque[joint] < told_velocity[joint] < told_nothing[joint]
        for rate in (133.0, 1000.0):
            alone = peaks("digital", "PD", rate)[joint]
            assert peaks("digital", "feedforward", rate)[joint] < alone
            assert peaks("digital", "computed torque", rate)[joint] < alone
    page = pages.page_of(running_house.answer("report", "last")["result"], session)
    assert page is not None
    assert "computed torque" in page


@pytest.mark.parametrize("command", [["certify", "dda-practice"], ["practise", "dda-practice"]])
def test_computed_torque_is_refused_with_its_reason(
    command: list[str], house: Any, capsys: pytest.CaptureFixture[str]
) -> None:
    """Before a daemon is looked for: a practice has to send what it learnt."""
    assert run([*command, "--mode", "cst", "--controller", "computed_torque"]) == outcomes.BAD_INPUT
    sentence = said(capsys)
    assert "measured state" in sentence
    assert "--mode cst practises with pd" in sentence
