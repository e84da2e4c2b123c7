"""Recordings of the campaign's plants, with friction in them, altered as users alter them: told, and never friction."""

from __future__ import annotations

import re
from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import pytest
from numpy.typing import NDArray

from benchmarks.campaign.arms import true_arm
from benchmarks.campaign.plans import Plan
from benchmarks.campaign.scenario import stage
from benchmarks.campaign.sealing import write_run
from config.loader import HERE
from estimator import RigidBody, Trajectory, load_rigid_body
from estimator.plausibility import Doubt, contradicting, examine, without_dead_velocities
from service.cli.entry import run

Array = NDArray[np.float64]
Alter = Callable[[Trajectory], Trajectory]
SEVEN = Plan(1, 7, "seven", ("coulomb_friction",), 5.0, 0.02, 12.0)
DDA = replace(SEVEN, arm="dda")


@dataclass(frozen=True)
class Recorded:
    urdf: Path
    files: tuple[Path, ...]
    body: RigidBody
    trajectories: tuple[Trajectory, ...]


def recorded(plan: Plan, folder: Path) -> Recorded:
    staged, joints = stage(plan, folder), true_arm(plan.arm).joints
    files = []
    for number, one in enumerate(staged.runs):
        files.append(folder / f"run-{number}.csv")
        write_run(one, joints, plan.arm == "dda", files[-1])
    trajectories = tuple(Trajectory(r.t, r.q, r.tau, r.dq if plan.arm == "dda" else None) for r in staged.runs)
    return Recorded(staged.urdf, tuple(files), load_rigid_body(staged.urdf), trajectories)


@pytest.fixture(scope="module")
def seven(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(SEVEN, tmp_path_factory.mktemp("seven"))


@pytest.fixture(scope="module")
def dda(tmp_path_factory: pytest.TempPathFactory) -> Recorded:
    return recorded(DDA, tmp_path_factory.mktemp("dda"))


def doubted(arm: Recorded, alter: Alter) -> Doubt:
    (doubt,) = examine(arm.body, [alter(t) for t in arm.trajectories], believed=True)
    assert doubt.wrong
    assert "friction" not in doubt.problem or doubt.kind == "another arm"
    return doubt


def exchanged(channel: str, a: int, b: int) -> Alter:
    def alter(trajectory: Trajectory) -> Trajectory:
        values = getattr(trajectory, channel).copy()
        values[:, [a, b]] = values[:, [b, a]]
        return replace(trajectory, **{channel: values})

    return alter


def scaled(channel: str, size: float | Sequence[float]) -> Alter:
    return lambda trajectory: replace(trajectory, **{channel: getattr(trajectory, channel) * np.array(size)})


def test_friction_is_no_wrong_input(seven: Recorded, dda: Recorded) -> None:
    for arm in (seven, dda):
        assert examine(arm.body, arm.trajectories, believed=True) == []


def test_kinematics_alone_tell_another_arm(seven: Recorded) -> None:
    """What bodies of any weight cannot have done; and this arm's own, without its masses, are not doubted."""
    own = re.sub("<inertial>.*?</inertial>", "", seven.urdf.read_text(), flags=re.DOTALL)
    assert examine(load_rigid_body(own), seven.trajectories, believed=True) == []
    parallel = re.sub('rpy="[^"]*"', 'rpy="0 0 0"', own)
    (doubt,) = examine(load_rigid_body(parallel), seven.trajectories, believed=True)
    assert (doubt.kind, doubt.wrong) == ("another arm", True)


@pytest.mark.parametrize("size", [1e3, 1.0 / 9.80665, 10.197, -1.0], ids=["mN·m", "kgf·m", "kgf·cm", "sign"])
def test_torques_of_all_joints(size: float, seven: Recorded) -> None:
    assert doubted(seven, scaled("tau", size)).kind == ("torque sign" if size < 0.0 else "torque scale")


def test_rough_masses_are_identified_and_not_refused(seven: Recorded) -> None:
    """What the model is only a first guess for, is a warning; the model that is to be judged is not off by ten."""
    altered = [scaled("tau", 10.197)(t) for t in seven.trajectories]
    (doubt,) = examine(seven.body, altered)
    assert not doubt.wrong


@pytest.mark.parametrize("stiffness", [0.3, 1.0, 4.0])
def test_a_strong_spring_at_a_light_wrist_is_no_wrong_unit(stiffness: float, seven: Recorded) -> None:
    """Read as kN·m, that torque outweighs all others, which are explained the better then, and itself the worse."""

    def pulled(trajectory: Trajectory) -> Trajectory:
        tau = trajectory.tau.copy()
        tau[:, 6] += stiffness * np.tanh(3.0 * (trajectory.q[:, 6] - float(np.mean(trajectory.q[:, 6]))))
        return replace(trajectory, tau=tau)

    assert [d for d in examine(seven.body, [pulled(t) for t in seven.trajectories], believed=True) if d.wrong] == []


def test_torques_of_one_joint(seven: Recorded) -> None:
    one = np.where(np.arange(7) == 6, 1e3, 1.0)
    doubt = doubted(seven, scaled("tau", one.tolist()))
    assert (doubt.kind, doubt.joints) == ("torque scale", ("joint7",))
    doubt = doubted(seven, scaled("tau", np.sign(1.5 - one).tolist()))
    assert (doubt.kind, doubt.joints) == ("torque sign", ("joint7",))


@pytest.mark.parametrize(("channel", "kind"), [("tau", "torque order"), ("q", "angle order")])
def test_one_channel_of_two_joints_exchanged(channel: str, kind: str, dda: Recorded) -> None:
    without = replace(dda, trajectories=tuple(replace(t, dq=None) for t in dda.trajectories))
    doubt = doubted(without, exchanged(channel, 1, 2))
    assert (doubt.kind, doubt.joints) == (kind, ("joint2", "joint3"))


def test_another_zero_of_an_angle(seven: Recorded) -> None:
    quarter = np.where(np.arange(7) == 1, 0.5 * np.pi, 0.0)
    doubt = doubted(seven, lambda t: replace(t, q=t.q + quarter))
    assert (doubt.kind, doubt.joints) == ("angle zero", ("joint2",))
    assert "-90°" in doubt.problem
    tenth = 0.02 * quarter
    assert examine(seven.body, [replace(t, q=t.q + tenth) for t in seven.trajectories], believed=True) == []


def test_velocities_that_are_no_derivative(dda: Recorded) -> None:
    assert doubted(dda, scaled("dq", -1.0)).kind == "velocity sign"
    doubt = doubted(dda, scaled("dq", [1.0, 30.0 / np.pi, 1.0]))
    assert (doubt.kind, doubt.joints) == ("velocity scale", ("joint2",))
    assert "revolutions" in doubt.problem
    weak = scaled("dq", [1.0, 0.7, 1.0])
    assert examine(dda.body, [weak(t) for t in dda.trajectories], believed=True) == []


def other_arm(joints: int, load: float) -> str:
    """A chain of another shape: every second axis is turned by a right angle, links along x."""
    text = "<robot name='other'><link name='l0'/>"
    for k in range(1, joints + 1):
        text += (
            f"<link name='l{k}'><inertial><origin xyz='.2 .05 0'/><mass value='{load * (joints + 1 - k)}'/>"
            "<inertia ixx='.02' ixy='0' ixz='0' iyy='.02' iyz='0' izz='.02'/></inertial></link>"
            f"<joint name='joint{k}' type='revolute'><parent link='l{k - 1}'/><child link='l{k}'/>"
            f"<origin xyz='.35 0 0' rpy='{1.57 * (k % 2)} 0 {0.4 * k}'/><axis xyz='0 0 1'/>"
            "<limit lower='-6' upper='6' velocity='9' effort='300'/></joint>"
        )
    return text + "</robot>"


def cut(trajectory: Trajectory, seconds: float) -> Trajectory:
    end = round(seconds * trajectory.rate)
    assert end < len(trajectory.t)
    dq = None if trajectory.dq is None else trajectory.dq[:end]
    return Trajectory(trajectory.t[:end], trajectory.q[:end], trajectory.tau[:end], dq)


@pytest.mark.parametrize(
    ("alter", "kind"),
    [
        (lambda t: scaled("dq", np.rad2deg(1.0))(scaled("q", np.rad2deg(1.0))(t)), "angles in degrees"),
        (scaled("tau", 1e3), "torque scale"),
        (scaled("tau", [-1.0, 1.0, 1.0]), "torque sign"),
        (exchanged("tau", 1, 2), "torque order"),
        (lambda t: exchanged("tau", 1, 2)(exchanged("dq", 1, 2)(exchanged("q", 1, 2)(t))), "joint order"),
    ],
    ids=["degrees", "mN·m", "sign", "torques", "joints"],
)
def test_two_seconds_are_enough_to_be_told(alter: Alter, kind: str, dda: Recorded) -> None:
    """Direct drive arms play motions of that length; what is identified of them is refused like what is diagnosed."""
    short = [cut(t, 2.1) for t in dda.trajectories]
    assert examine(dda.body, short) == examine(dda.body, short, believed=True) == []
    (doubt,) = examine(dda.body, [alter(t) for t in short])
    assert (doubt.kind, doubt.wrong) == (kind, True)


def test_the_urdf_of_another_arm(
    seven: Recorded, tmp_path: Path, capsys: pytest.CaptureFixture[str], monkeypatch: pytest.MonkeyPatch
) -> None:
    monkeypatch.setenv("ETUDE_STATE", str(tmp_path / "state"))
    urdf = tmp_path / "other.urdf"
    urdf.write_text(other_arm(7, 1.0))
    assert run(["diagnose", *map(str, seven.files), "--arm", str(urdf)]) == 2
    shown = capsys.readouterr()
    (line,) = [line for line in shown.err.splitlines() if line.startswith("etude: ")]
    assert "URDF" in line
    assert shown.out == ""


def test_the_same_kinematics_without_masses_are_allowed(seven: Recorded) -> None:
    bare = "".join(part.split("</inertial>")[-1] for part in seven.urdf.read_text().split("<inertial>"))
    assert examine(load_rigid_body(bare), seven.trajectories, believed=True) == []


@pytest.mark.parametrize(
    "alter",
    [scaled("tau", 1e3), scaled("tau", -1.0), scaled("tau", [1.0, -1.0, 1.0]), exchanged("tau", 1, 2)],
    ids=["mN·m", "signs", "sign", "order"],
)
def test_one_recording_that_contradicts_the_others(alter: Alter, dda: Recorded) -> None:
    """Taken together with them it may drown them, or be drowned."""
    right = [replace(t, dq=None) for t in dda.trajectories]
    assert contradicting(dda.body, right, right) == {}
    assert contradicting(dda.body, right[1:], right[:1]) == {}
    wrong = [alter(right[0]), *right[1:]]
    assert 0 in contradicting(dda.body, wrong, wrong)
    assert list(contradicting(dda.body, right[1:], wrong[:1])) == [0]


def test_one_joint_in_another_unit_is_told_with_its_size(dda: Recorded) -> None:
    doubt = doubted(dda, scaled("tau", [1.0, 5.0, 1.0]))
    assert (doubt.kind, doubt.joints) == ("torque scale", ("joint2",))
    assert "joint2 is 5" in doubt.problem
    doubt = doubted(dda, scaled("tau", [1.0, 10.0, 1.0]))
    assert (doubt.kind, doubt.joints) == ("torque scale", ("joint2",))


def test_an_angle_that_runs_the_other_way_is_not_taken_for_its_torque(dda: Recorded) -> None:
    turned = scaled("q", [1.0, -1.0, 1.0])
    doubt = doubted(dda, lambda t: replace(turned(t), dq=None))
    assert (doubt.kind, doubt.joints) == ("angle sign", ("joint2",))


def test_one_angle_in_degrees(seven: Recorded) -> None:
    one = np.where(np.arange(7) == 1, np.rad2deg(1.0), 1.0)
    doubt = doubted(seven, scaled("q", one.tolist()))
    assert (doubt.kind, doubt.joints) == ("angles in degrees", ("joint2",))


def test_a_body_that_is_only_like_this_one_is_not_refused(seven: Recorded) -> None:
    """The shipped arm's links lack the rotors that this plant has in them: of some joints more than half."""
    shipped = load_rigid_body(HERE / "arms" / "seven" / "seven.urdf")
    assert examine(shipped, seven.trajectories, believed=True) == []


@pytest.mark.parametrize("size", [2.0, 0.4536, 3.0, 0.7376], ids=["2", "lb", "3", "lbf·ft"])
def test_torques_that_are_off_alike(size: float, seven: Recorded) -> None:
    """By one factor at every joint: a unit, of the torques or of the masses, and no load."""
    doubt = doubted(seven, scaled("tau", size))
    assert doubt.kind == "torque scale"
    assert "alike" in doubt.problem
    assert ("masses in lb" in doubt.problem) == (size == 0.4536)
    assert ("in lbf·ft" in doubt.problem) == (size == 0.7376)


def test_what_may_be_a_torque_constant_is_a_warning(seven: Recorded) -> None:
    (doubt,) = examine(seven.body, [scaled("tau", 0.83)(t) for t in seven.trajectories], believed=True)
    assert not doubt.wrong
    assert "alike" in doubt.problem
    assert "lbf·ft" not in doubt.problem


def test_velocities_of_other_joints(dda: Recorded) -> None:
    for a, b in ((0, 1), (1, 2)):
        doubt = doubted(dda, exchanged("dq", a, b))
        assert (doubt.kind, doubt.joints) == ("velocity order", (f"joint{a + 1}", f"joint{b + 1}"))


def test_velocities_that_nobody_measured(dda: Recorded) -> None:
    """Zeros of a driver that measures none are no sensor's gain."""
    moving, doubts = without_dead_velocities(dda.body, [scaled("dq", [1.0, 0.0, 1.0])(dda.trajectories[0])])
    assert moving[0].dq is None
    assert [(doubt.kind, doubt.joints, doubt.wrong) for doubt in doubts] == [
        ("dead velocity channel", ("joint2",), False)
    ]
    assert without_dead_velocities(dda.body, dda.trajectories) == (list(dda.trajectories), [])
