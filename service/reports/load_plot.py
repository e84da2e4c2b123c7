"""Measured against predicted wrench, after the thesis' Fig. 3.4 and 3.5: does the load say what the wrist felt?"""

from __future__ import annotations

from pathlib import Path

import numpy as np

from estimator.loads import WrenchHistory
from estimator.loads.from_torques import TorqueDifference
from service.reports.style import ACCENT, figure, finish


def plot_wrenches(path: Path, title: str, history: WrenchHistory) -> None:
    """One panel a channel: measured, and predicted by the identified load with the sensor's offset.

    Raises InputError when the file cannot be written.
    """
    fig, axes = figure(len(history.channels), title)
    for k, (axis, name) in enumerate(zip(axes, history.channels, strict=True)):
        unit = "N" if name.startswith("f") else "N·m"
        off = float(np.sqrt(np.nanmean((history.measured[:, k] - history.predicted[:, k]) ** 2)))
        axis.plot(history.t, history.measured[:, k], color="black", lw=2.0, label="measured")
        label = f"predicted, off by {off:.3g} {unit} rms"
        axis.plot(history.t, history.predicted[:, k], color=ACCENT, lw=1.2, label=label)
        axis.set_ylabel(f"{name} [{unit}]")
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)


def plot_torque_difference(path: Path, title: str, joints: tuple[str, ...], history: TorqueDifference) -> None:
    """One panel a joint: torque beyond what the free arm needs, and what the identified load needs of it.

    Raises InputError when the file cannot be written.
    """
    fig, axes = figure(len(joints), title)
    for k, (axis, joint) in enumerate(zip(axes, joints, strict=True)):
        axis.plot(history.t, history.measured[:, k], color="black", lw=2.0, label="beyond the free arm")
        axis.plot(history.t, history.predicted[:, k], color=ACCENT, lw=1.2, label="of the identified load")
        axis.set_ylabel(f"{joint}\ntorque [N·m]")
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)
