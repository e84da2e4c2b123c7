"""Kinova Gen3: seven joints with torque sensors and motor currents (W. Chiha, dynamic-identification)."""

from __future__ import annotations

import csv

import numpy as np

from benchmarks.measured.dataset import Array, MeasuredArm, data_folder
from estimator import Trajectory

FOLDER = "kinova_gen3"
RECORDINGS = ("opti_traj_testing1", "opti_traj_testing2", "RunTrajectory1")
PERIOD = 1e-3
"""s. The time column counts samples; velocities against differences of angles say that one is a millisecond."""
SENSORS, MOTORS = "TorqueSm", "TorqueCur"
"""Torques of the joints' sensors, and by the motors' currents."""


def kinova() -> MeasuredArm:
    """The torques are those of the joints' sensors, those of the motors beside them. The commanded motion is recorded
    whole in two of the recordings only."""
    return MeasuredArm(
        "kinova",
        (data_folder(FOLDER) / "gen3.urdf").read_text(),
        {name: _recording(name, SENSORS) for name in RECORDINGS},
        held_out=("opti_traj_testing2", "RunTrajectory1"),
        motors={name: _recording(name, MOTORS).tau for name in RECORDINGS},
    )


def _recording(name: str, torque: str) -> Trajectory:
    with (data_folder(FOLDER) / f"{name}.csv").open() as lines:
        header, *rows = list(csv.reader(lines))
    values = np.array([[float(field) if field else np.nan for field in row] for row in rows])

    def channel(quantity: str) -> Array:
        return values[:, [header.index(f"{quantity}{joint}") for joint in range(1, 8)]]

    commanded = channel("PositionCmptd")
    return Trajectory(
        t=values[:, 0] * PERIOD,
        q=channel("Position"),
        tau=channel(torque),
        dq=channel("Velocity"),
        q_desired=commanded if np.isfinite(commanded).all() else None,
        name=name,
        temperature=channel("Temp"),
    )
