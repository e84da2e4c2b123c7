"""KUKA KR300 R2500 ultra, six axes, about 200 kg at the flange (Weigand, Götz, Ulmen, Ruskowski 2021)."""

from __future__ import annotations

from typing import Any, Literal

import numpy as np
from scipy.io import loadmat

from benchmarks.measured.dataset import Array, MeasuredArm, data_folder
from benchmarks.measured.kinematics import DhRow, JointLimits, turned_about_x, urdf_of_standard_dh
from estimator import Trajectory

FOLDER = "kuka_kr300"
GEAR_RATIOS = np.array([1798 / 7, 1872 / 7, 757 / 3, 221.0, 5032 / 21, 206793 / 1340])
START = np.radians([0.0, -90.0, 90.0, 0.0, 0.0, 0.0])
"""Angles were recorded from the pose where each motion starts: upper arm upright, forearm level. With it the mass
matrix and the gravity torques that the recordings carry follow from the table below to 0.5 %; without, to 30 %."""
TABLE = (
    DhRow(-0.675, 0.350, np.pi / 2),
    DhRow(-0.189, 1.150, 0.0),
    DhRow(0.189, 0.041, -np.pi / 2, offset=np.pi / 2),
    DhRow(-1.0, 0.0, np.pi / 2),
    DhRow(0.0, 0.0, -np.pi / 2),
    DhRow(-0.24, 0.0, np.pi),
)
_DEGREES = ((-147, 147), (-140, -5), (-112, 153), (-350, 350), (-122.5, 122.5), (-350, 350))
_TORQUE = 40.0
"""N·m of a motor, at the most."""
LIMITS = tuple(
    JointLimits(float(np.radians(low)), float(np.radians(high)), 1.8, float(_TORQUE * ratio))
    for (low, high), ratio in zip(_DEGREES, GEAR_RATIOS, strict=True)
)
AngleSide = Literal["link", "motor"]


def kuka(angles: AngleSide = "motor") -> MeasuredArm:
    """Torques at the joints: those of the motors times the gears. ``angles`` of axes 1–3 by the encoders on the links,
    those of the motors beside them, or by the motors' alone; axes 4–6 have the latter only."""
    urdf = urdf_of_standard_dh("kuka_kr300", TABLE, LIMITS, turned_about_x(np.pi))
    recordings = {f"kuka_{letter}": _recording(letter, angles) for letter in "ABC"}
    beside = {f"kuka_{letter}": _motor_angles(letter) for letter in "ABC"} if angles == "link" else {}
    return MeasuredArm("kuka", urdf, recordings, held_out=("kuka_C",), motor_angles=beside)


def _motor_angles(letter: str) -> Array:
    result = _recording(letter, "motor").q.copy()
    result[:, 3:] = np.nan
    return result


def _recording(letter: str, angles: AngleSide) -> Trajectory:
    content: Any = loadmat(data_folder(FOLDER) / f"recorded_{letter}.mat", squeeze_me=True, struct_as_record=False)
    recorded = content["rec"]

    def channel(name: str) -> Array:
        return np.asarray(getattr(recorded, name), dtype=float).T

    q, dq = channel("act_pos_mot_deg"), channel("act_vel_mot_deg_per_s")
    if angles == "link":
        q[:, :3], dq[:, :3] = channel("act_pos_se_deg")[:, :3], channel("act_vel_se_deg_per_s")[:, :3]
    return Trajectory(
        t=np.asarray(recorded.time_cont, dtype=float),
        q=START + np.radians(q),
        tau=channel("act_torque_abs_nm") * GEAR_RATIOS,
        dq=np.radians(dq),
        q_desired=START + np.radians(channel("ref_pos_deg")),
        name=f"kuka_{letter}",
    )
