"""A brushless motor turned slowly by an ODrive: cogging, and its compensation (gchenfc/ODrive)."""

from __future__ import annotations

import numpy as np

from benchmarks.measured.dataset import Array, MeasuredArm, data_folder
from estimator import Trajectory

FOLDER = "odrive_cogging"
COUNTS = 8192
"""Of the encoder, one revolution."""
SLOW_MOTIONS = (
    "slow2/nocomp_0",
    "slow2/nocomp_1",
    "slow2/nocomp_2",
    "slow2/comp_0",
    "slow2/comp_1",
    "slow2/comp_2",
    "slow2_slower/nocomp_0",
    "slow2_slower/comp_0",
    "slow2_slower/crosstalk_nocomp_0",
    "slow2_slower/crosstalk_comp_0",
)
URDF = """<robot name='odrive'>
<link name='stator'/>
<link name='rotor'/>
<joint name='shaft' type='continuous'><parent link='stator'/><child link='rotor'/><axis xyz='0 0 1'/>
<limit velocity='100' effort='20'/></joint>
</robot>
"""


def odrive() -> MeasuredArm:
    """The motor's torque constant is not known: ``tau`` is the current [A], torque for a constant of 1 N·m/A. The shaft
    carries nothing; its velocity was not measured. `comp`: with compensation of cogging; `crosstalk`: the motor beside
    it moves."""
    names = {name: "odrive_" + name.replace("/", "_") for name in SLOW_MOTIONS}
    return MeasuredArm("odrive", URDF, {label: _slow_motion(name, label) for name, label in names.items()})


def _slow_motion(name: str, label: str) -> Trajectory:
    t, position, current = np.load(data_folder(FOLDER) / f"{name}.npy")
    angle = position * (2.0 * np.pi / COUNTS)
    return Trajectory(t, angle[:, None], current[:, None], name=label)


def cogging_map(name: str) -> tuple[Array, Array]:
    """Angle [rad] and current [A] that held the shaft there, of the map ``cogging_measure_final_<name>.npy``; counts
    that were not measured are left out."""
    current: Array = np.load(data_folder(FOLDER) / "coggingmap_0" / f"cogging_measure_final_{name}.npy")
    measured = np.flatnonzero(np.ones(COUNTS) if name.endswith("_interp") else current)
    return np.asarray(measured * (2.0 * np.pi / COUNTS)), current[measured]
