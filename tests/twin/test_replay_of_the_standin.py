"""The twin against the stand-in, whose mechanics are other code: a run in lockstep through the wire, replayed."""

from __future__ import annotations

import multiprocessing
from pathlib import Path

import numpy as np
import pytest

from config import Installation, load_installation
from config.loader import HERE
from config.motion import load_motion, point_to_point, sample
from driver.arm import ArmLoop
from driver.plan import Plan
from driver.recording import RecorderProcess, Recording, read_recording
from estimator.arm_model import ArmModel, FittedEffect
from estimator.effects import Place
from estimator.rigid_body import load_rigid_body
from estimator.trajectory import Trajectory
from estimator.twin.replay import replay
from service.diagnosis.simulating import controller_of
from service.identification.recorded import trajectory_of
from virtual_hw.standin import run_standin

HIDDEN = """
description = "the URDF's arm, with friction in joint 2 and a rotor in joint 3"
[[friction]]
joint = "joint2"
level_nm = 3.0
viscous_nms_rad = 1.0
presliding_rad = 1e-5
[[rotor_inertia]]
joint = "joint3"
inertia_kg_m2 = 0.05
"""
TRUTH = (
    FittedEffect("coulomb_friction", Place(1), {"level": 3.0}),
    FittedEffect("viscous_friction", Place(1), {"coefficient": 1.0}),
    FittedEffect("rotor_inertia", Place(2), {"inertia": 0.05}),
)


@pytest.fixture(scope="module")
def recording(tmp_path_factory: pytest.TempPathFactory) -> Recording:
    """An identification motion of the direct drive arm."""
    directory = tmp_path_factory.mktemp("standin")
    hidden = directory / "hidden.toml"
    hidden.write_text(HIDDEN)
    arm = load_installation("dda")
    with pytest.MonkeyPatch.context() as patch:
        patch.setenv("ETUDE_RUN", str(directory))
        return read_recording(play(arm, hidden, directory))


def play(installation: Installation, hidden: Path, directory: Path) -> Path:
    context = multiprocessing.get_context("spawn")
    ready = context.Event()
    standin = context.Process(
        target=run_standin, args=(installation, str(hidden), True, 1, ready.set, directory), daemon=True
    )
    standin.start()
    try:
        assert ready.wait(60), "the stand-in did not come up"
        with (
            ArmLoop.start(installation, lockstep=True, ring_name="t") as loop,
            RecorderProcess.start(installation, "t", directory) as recorder,
        ):
            loop.enable("csp")
            motion = sample(load_motion("dda-identify-1", installation), installation.cycle.rate_hz)
            approach = point_to_point(np.array(loop.status().q), motion.q[0], installation)
            run = loop.play(Plan(approach.q, approach.dq, approach.ddq, mode="csp", controller="pd", name="approach"))
            assert loop.wait(run).run_outcome == "done"
            recorder.start_run("motion", metadata={"mode": "csp"})
            run = loop.play(Plan(motion.q, motion.dq, motion.ddq, mode="csp", controller="pd", name="motion"))
            assert loop.wait(run).run_outcome == "done"
            path = recorder.stop_run()
            loop.disable()
            return path
    finally:
        standin.terminate()
        standin.join()


def test_the_recorded_servos_move_the_true_model_as_they_moved_the_arm(recording: Recording) -> None:
    body = load_rigid_body(HERE / "arms" / "dda" / "dda.urdf")
    trajectory = trajectory_of(recording, body, "recorded")
    servos = controller_of(recording, trajectory, body)
    assert "recorded commands" in servos.kind
    tracking = np.sqrt(np.nanmean((recording.q_d - trajectory.q) ** 2, axis=0))
    given, true = (replay(ArmModel(body, effects), trajectory, servos) for effects in ((), TRUTH))
    np.testing.assert_array_less(true.position_error(trajectory), 0.02 * tracking)
    wrong, right = (run.position_error(trajectory) for run in (given, true))
    assert wrong[1] > 10.0 * right[1]
    assert wrong[2] > 3.0 * right[2]
    torque_error = np.sqrt(np.nanmean((true.tau - trajectory.tau) ** 2, axis=0))
    np.testing.assert_array_less(torque_error, 0.02 * np.sqrt(np.mean(trajectory.tau**2, axis=0)))


def test_without_commands_the_torques_are_replayed(recording: Recording) -> None:
    body = load_rigid_body(HERE / "arms" / "dda" / "dda.urdf")
    whole = trajectory_of(recording, body, "recorded")
    foreign = Trajectory(whole.t, whole.q, whole.tau, whole.dq)
    controller = controller_of(Recording(**{**vars(recording), "installation": None}), foreign, body)
    assert "recorded torques" in controller.kind
    wrong, right = (
        replay(ArmModel(body, effects), foreign, controller).position_error(foreign) for effects in ((), TRUTH)
    )
    assert wrong[1] > 10.0 * right[1]
