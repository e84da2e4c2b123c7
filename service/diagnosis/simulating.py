"""The twin beside the recordings: how far its angles are off, with the given model and with the extended one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from driver.recording import Recording
from estimator.arm_model import ArmModel
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory
from estimator.twin.replay import replay
from estimator.twin.tracking import (
    Tracking,
    drive_servo,
    estimated_servo,
    host_controller,
    torque_replay,
    velocities,
)

Array = NDArray[np.float64]

LONGEST = 20.0
"""s of motion that are replayed in all, of the recordings that come first."""
CYCLES_TO_ACT = 2.0
"""Between a recorded command and its effect in a drive, see `estimator.twin.tracking.drive_servo`."""


@dataclass(frozen=True)
class Replayed:
    """Position error of the replay with the model as given and as extended: rms over all joints, and (n,) of each."""

    before: float
    after: float
    before_joints: Array
    after_joints: Array
    controller: str
    seconds: float


def replay_both(
    given: ArmModel, extended: ArmModel, recordings: Sequence[Recording], trajectories: Sequence[Trajectory]
) -> Replayed:
    """Replay the recordings under the controller that made them. Raises InputError when a model cannot be simulated."""
    squares: list[list[Array]] = [[], []]
    seconds, controllers = 0.0, []
    for recording, trajectory in zip(recordings, trajectories, strict=True):
        count = int(np.searchsorted(trajectory.t - trajectory.t[0], LONGEST - seconds, side="right"))
        if seconds > 0.0 and count < len(trajectory.t):
            break
        part = first(trajectory, count)
        controller = controller_of(recording, trajectory, given.body)
        controllers.append(controller.kind)
        cut = replace(controller, q=controller.q[:count], dq=controller.dq[:count], tau=controller.tau[:count])
        for model, errors in zip((given, extended), squares, strict=True):
            errors.append((replay(model, part, cut).q - part.q) ** 2)
        seconds += float(part.t[-1] - part.t[0])
    before, after = (np.sqrt(np.nanmean(np.concatenate(errors), axis=0)) for errors in squares)
    return Replayed(
        before=float(np.sqrt(np.mean(before**2))),
        after=float(np.sqrt(np.mean(after**2))),
        before_joints=before,
        after_joints=after,
        controller="; ".join(dict.fromkeys(controllers)),
        seconds=seconds,
    )


def first(trajectory: Trajectory, count: int) -> Trajectory:
    """Its first samples."""

    def part(channel: Array | None) -> Array | None:
        return None if channel is None else channel[:count]

    return replace(
        trajectory,
        t=trajectory.t[:count],
        q=trajectory.q[:count],
        tau=trajectory.tau[:count],
        dq=part(trajectory.dq),
        ddq=part(trajectory.ddq),
        q_desired=part(trajectory.q_desired),
    )


def controller_of(recording: Recording, trajectory: Trajectory, body: RigidBody) -> Tracking:
    """Who moved the arm: the installation's servos or host controller, as the recording says; of a foreign recording
    servos estimated from the commands where it has some, else its torques with a feedback of declared bandwidth."""
    dq = velocities(trajectory)
    installation = recording.installation
    if installation is not None and trajectory.q_desired is not None:
        joints = {joint.name: joint for joint in installation.joint}
        drives = [joints[name] for name in body.joints]
        columns = body.columns(recording.joints)
        if recording.metadata.get("mode") == "cst":
            gains = np.array([(j.digital.stiffness_nm_rad, j.digital.damping_nms_rad) for j in drives])
            return host_controller(trajectory, dq, gains[:, 0], gains[:, 1])
        if recording.dq_d is not None:
            gains = np.array([(j.servo.stiffness_nm_rad, j.servo.damping_nms_rad) for j in drives])
            forward = None if recording.tau_ff is None else recording.tau_ff[:, columns]
            late = CYCLES_TO_ACT / installation.cycle.rate_hz
            commanded = recording.dq_d[:, columns]
            return drive_servo(trajectory, trajectory.q_desired, commanded, forward, gains[:, 0], gains[:, 1], late)
    return estimated_servo(trajectory, dq) or torque_replay(body, trajectory, dq)
