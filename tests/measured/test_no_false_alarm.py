"""Recordings that are what they are said to be are not doubted."""

from __future__ import annotations

from dataclasses import replace

import numpy as np
import pytest

from benchmarks.measured import ADAPTORS, is_here, panda, whole_panda
from estimator.plausibility import examine, leaps, turns, without_unusable_torques

DEAD = {"kinova_gen3": [("dead torque channel", ("joint_1",))]}
"""The torque sensor of joint 1 says zero throughout the Kinova's RunTrajectory1: no false alarm."""


@pytest.mark.parametrize("folder", ADAPTORS)
def test_measured_recordings_are_not_doubted(folder: str) -> None:
    if not is_here(folder):
        pytest.skip(f"{folder} is not in ../shared/data")
    arm = ADAPTORS[folder]()
    usable, doubts = without_unusable_torques(arm.body, list(arm.recordings.values()))
    assert [(doubt.kind, doubt.joints) for doubt in doubts] == DEAD.get(folder, [])
    assert examine(arm.body, usable) == []
    assert examine(arm.body, usable, believed=True) == []


@pytest.mark.parametrize("folder", ADAPTORS)
def test_measured_angles_do_not_leap(folder: str) -> None:
    if not is_here(folder):
        pytest.skip(f"{folder} is not in ../shared/data")
    for recording in ADAPTORS[folder]().recordings.values():
        for angle in recording.q.T:
            assert leaps(recording.t, angle).size == 0
            assert not np.any(turns(angle) > 0.0)
            assert not np.any(turns(angle) < 0.0)


def test_a_measured_recording_with_joints_out_of_order() -> None:
    if not is_here("franka_panda"):
        pytest.skip("franka_panda is not in ../shared/data")
    right = whole_panda()
    order = [0, 1, 3, 2, 4, 5, 6]
    wrong = replace(right, q=right.q[:, order], tau=right.tau[:, order], dq=np.asarray(right.dq)[:, order])
    (doubt,) = examine(panda().body, [wrong])
    assert doubt.kind == "joint order"
    assert doubt.joints == ("joint3", "joint4")


def test_a_measured_recording_altered() -> None:
    """What only the given masses can tell: torques by themselves out of order, an angle's zero, a unit."""
    if not is_here("franka_panda"):
        pytest.skip("franka_panda is not in ../shared/data")
    right, body = whole_panda(), panda().body
    order, quarter = [0, 1, 3, 2, 4, 5, 6], np.where(np.arange(7) == 3, 0.5 * np.pi, 0.0)
    altered = {
        "torque order": replace(right, tau=right.tau[:, order]),
        "angle zero": replace(right, q=right.q + quarter),
        "torque scale": replace(right, tau=right.tau / 9.80665),
    }
    half = panda().recordings["panda_first_half"]
    altered["torque sign"] = replace(half, tau=-half.tau)
    for kind, wrong in altered.items():
        (doubt,) = examine(body, [wrong], believed=True)
        assert doubt.kind == kind
        assert doubt.wrong
    assert doubt.joints == body.joints, "and not the angle of one joint, whose sign explains a little"
