"""Franka Panda: seven joints with torque sensors (Gaz, Cognetti, Oliva, Robuffo Giordano, De Luca 2019)."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from benchmarks.measured.dataset import MeasuredArm, data_folder
from config.loader import HERE
from estimator import Trajectory

FOLDER = "franka_panda"


def panda() -> MeasuredArm:
    """One recording of 21 s, as jittered as it is, cut in two halves; the second is held out."""
    path = data_folder(FOLDER)
    t = np.loadtxt(path / "exciting_traj_time.txt")
    q, dq, tau = (
        np.loadtxt(path / f"exciting_traj_{name}.txt").reshape(-1, 7) for name in ("positions", "velocity", "torques")
    )
    half = len(t) // 2
    return MeasuredArm(
        "panda",
        (HERE / "arms" / "panda" / "panda.urdf").read_text(),
        {
            name: Trajectory(t[part], q[part], tau[part], dq[part], name=name)
            for name, part in (("panda_first_half", slice(half)), ("panda_second_half", slice(half, None)))
        },
        held_out=("panda_second_half",),
    )


def whole_panda() -> Trajectory:
    """Both halves as the one recording that they are: what the published figure was taken on."""
    first, second = panda().recordings.values()
    assert first.dq is not None
    assert second.dq is not None
    return replace(
        first,
        t=np.concatenate([first.t, second.t]),
        q=np.concatenate([first.q, second.q]),
        tau=np.concatenate([first.tau, second.tau]),
        dq=np.concatenate([first.dq, second.dq]),
        name="panda",
    )
