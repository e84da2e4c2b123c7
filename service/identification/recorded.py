"""From recordings in any format Étude reads to the estimator's trajectories."""

from __future__ import annotations

import hashlib
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from config import InputError
from driver.recording import Recording, read_recording
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory
from service.identification.arm_source import ArmSource
from service.identification.text_channels import is_text_channels, read_text_channels

DIGEST_BLOCK = 1 << 20
DRIVES_OFF = {"drives": "off"}
"""Metadata of a recording that was made with the drives off."""


@dataclass(frozen=True)
class Source:
    """What a model was learnt from: enough to find it again, and to know that it is still the same."""

    path: str
    sha256: str
    samples: int
    duration_s: float


def read_any(path: Path, arm: ArmSource | None, topic: str) -> Recording:
    """A recording of ours, a foreign MCAP or CSV, or a directory of text channels (which carry no joint names:
    they are taken as the arm's joints in its order)."""
    if is_text_channels(path):
        if arm is None:
            raise InputError(str(path), "does not say which arm it is of", "name it: --arm NAME, or --arm FILE.urdf")
        return read_text_channels(path, arm.all_joints())
    return read_recording(path, topic)


def trajectory_of(recording: Recording, body: RigidBody, name: str) -> Trajectory:
    """The recording's channels in the body's order of joints.

    Raises InputError when a joint or its torque was not recorded.
    """
    columns = body.columns(recording.joints)
    if recording.tau is None or np.isnan(recording.tau[:, columns]).all():
        raise InputError(name, "has no measured torque", "identification needs the effort of every joint")
    return Trajectory(
        t=recording.t,
        q=recording.q[:, columns],
        tau=recording.tau[:, columns],
        dq=None if recording.dq is None else recording.dq[:, columns],
        q_desired=None if recording.q_d is None else recording.q_d[:, columns],
        name=name,
        temperature=None if recording.temperature is None else recording.temperature[:, columns],
    )


def source_of(path: Path, recording: Recording) -> Source:
    """Path, content address, length of a recording that was read."""
    files: Sequence[Path] = sorted(path.glob("*.txt")) if path.is_dir() else [path]
    digest = hashlib.sha256()
    for file in files:
        with file.open("rb") as content:
            while block := content.read(DIGEST_BLOCK):
                digest.update(block)
    return Source(str(path), digest.hexdigest(), len(recording.t), float(recording.t[-1] - recording.t[0]))
