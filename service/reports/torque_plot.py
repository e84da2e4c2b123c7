"""Measured against predicted torques, after the thesis' Fig. 4.4: does the model say what the joints felt?"""

from __future__ import annotations

from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.identification import LinkIdentification
from estimator.prediction import model_torque_history, torque_history
from estimator.trajectory import Trajectory
from service.reports.style import ACCENT, MUTED, figure, finish

Array = NDArray[np.float64]


def plot_torques(path: Path, arm: str, result: LinkIdentification, trajectory: Trajectory, *, held_out: bool) -> None:
    """One panel a joint: measured; predicted by the identified model and by the URDF as it was; how far each is off.

    Raises InputError when the recording has no gapless stretch to predict, or the file cannot be written.
    """
    identified = torque_history(result, trajectory)
    urdf = model_torque_history(result.body, result.body.prior(), trajectory, result.band)
    measured = identified.measured
    title = f"{arm}: torques of {Path(trajectory.name).stem}" + (", not learnt from" if held_out else "")
    fig, axes = figure(result.body.n, title)
    for i, (axis, joint) in enumerate(zip(axes, result.body.joints, strict=True)):
        axis.plot(identified.t, measured[:, i], color="black", lw=2.0, label="measured")
        axis.plot(
            urdf.t,
            urdf.predicted[:, i],
            color=MUTED,
            lw=1.2,
            ls="--",
            label=_label("URDF", urdf.predicted, measured, i, result.body.axes[i].torque_unit),
        )
        axis.plot(
            identified.t,
            identified.predicted[:, i],
            color=ACCENT,
            lw=1.2,
            label=_label("identified", identified.predicted, measured, i, result.body.axes[i].torque_unit),
        )
        unit = result.body.axes[i].torque_unit
        axis.set_ylabel(f"{joint}\n{'torque' if unit == 'N·m' else 'force'} [{unit}]")
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)


def _label(name: str, predicted: Array, measured: Array, joint: int, unit: str) -> str:
    off = float(np.sqrt(np.mean((predicted[:, joint] - measured[:, joint]) ** 2)))
    return f"{name}, off by {off:.3g} {unit} rms"
