"""The twin beside the recordings: how far its angles are off, with the given model and with the extended one."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config import InputError
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
    """Position error (n,) rms of the replay with the model as given and as extended; None where that model cannot be
    simulated, and a note why."""

    before: Array | None
    after: Array | None
    controller: str
    seconds: float
    notes: tuple[str, ...]


def replay_both(
    given: ArmModel, extended: ArmModel, recordings: Sequence[Recording], trajectories: Sequence[Trajectory]
) -> Replayed:
    """Replay the recordings under the controller that made them."""
    parts: list[tuple[Trajectory, Tracking]] = []
    seconds = 0.0
    for recording, trajectory in zip(recordings, trajectories, strict=True):
        count = int(np.searchsorted(trajectory.t - trajectory.t[0], LONGEST - seconds, side="right"))
        if seconds > 0.0 and count < len(trajectory.t):
            break
        part = trajectory.rows(slice(count))
        controller = controller_of(recording, trajectory, extended.body)
        cut = replace(controller, q=controller.q[:count], dq=controller.dq[:count], tau=controller.tau[:count])
        parts.append((part, cut))
        seconds += float(part.t[-1] - part.t[0])
    notes: list[str] = []
    before, after = (_error(model, name, parts, notes) for model, name in ((given, "given"), (extended, "extended")))
    kinds = "; ".join(dict.fromkeys(controller.kind for _, controller in parts))
    return Replayed(before, after, kinds, seconds, tuple(notes))


def _error(model: ArmModel, name: str, parts: Sequence[tuple[Trajectory, Tracking]], notes: list[str]) -> Array | None:
    try:
        squares = [(replay(model, part, controller).q - part.q) ** 2 for part, controller in parts]
    except InputError as error:
        notes.append(f"the {name} model is not simulated: {error}")
        return None
    return np.asarray(np.sqrt(np.nanmean(np.concatenate(squares), axis=0)))


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
