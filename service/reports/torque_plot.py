"""Measured against predicted torques, after the thesis' Fig. 4.4: does the model say what the joints felt?"""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from estimator.filtering import convolve, plan_filter, resample, smooth_motion
from estimator.identification import LinkIdentification
from estimator.regressor import inverse_dynamics
from estimator.trajectory import Trajectory
from service.reports.style import ACCENT, MUTED, figure, finish

Array = NDArray[np.float64]
LONGEST_S = 20.0
"""More of a recording than this cannot be told apart on paper."""


@dataclass(frozen=True)
class TorqueComparison:
    """Samples × joints, N·m, all smoothed alike (zero phase): measured; predicted with the identified parameters and
    joint terms; predicted with the URDF's own parameters."""

    t: Array
    measured: Array
    identified: Array
    urdf: Array


def compare_torques(result: LinkIdentification, trajectory: Trajectory) -> TorqueComparison:
    """Torques along the first gapless stretch of a recording, in the band of the identification."""
    plan = plan_filter(trajectory.rate, result.band)
    # The kinematics' kernel is flat to six times its plan's band: this one is flat to the band of the identification.
    in_band = plan_filter(plan.rate, result.band / 6.0).smooth
    longest = round(LONGEST_S * trajectory.rate)
    piece = next(trajectory.segments(longest, 0))
    t = trajectory.t[piece]
    q, tau = (resample(t, x[piece], plan.rate) for x in (trajectory.q, trajectory.tau))
    dq = None if trajectory.dq is None else resample(t, trajectory.dq[piece], plan.rate)
    motion = smooth_motion(plan, q, dq, None)
    body = result.body
    prior = body.prior()
    identified = inverse_dynamics(body, result.full_parameters(prior), motion.q, motion.dq, motion.ddq)
    for term, value in zip(result.terms, result.value[result.base.rank :], strict=True):
        identified[:, term.joint] += value * term.column(motion.dq[:, term.joint], motion.ddq[:, term.joint])
    urdf = inverse_dynamics(body, prior, motion.q, motion.dq, motion.ddq)
    measured = convolve(convolve(tau, plan.smooth), in_band)
    first = plan.edge + len(in_band) // 2
    return TorqueComparison(
        t=(t[0] - trajectory.t[0]) + (first + np.arange(len(measured))) / plan.rate,
        measured=measured,
        identified=convolve(identified, in_band),
        urdf=convolve(urdf, in_band),
    )


def plot_torques(path: Path, arm: str, result: LinkIdentification, trajectory: Trajectory, *, held_out: bool) -> None:
    """One panel a joint: measured, predicted by the identified model, predicted by the URDF; the residual's RMS."""
    c = compare_torques(result, trajectory)
    n = result.body.n
    name = Path(trajectory.name).stem
    title = f"{arm}: torques of {name}" + (", held out" if held_out else "")
    fig, axes = figure(n, title)
    for i, (axis, joint) in enumerate(zip(axes, result.body.joints, strict=True)):
        axis.plot(
            c.t, c.urdf[:, i], color=MUTED, lw=1.2, ls="--", label=f"URDF, off by {_rms(c.urdf, c, i):.3g} N·m rms"
        )
        axis.plot(c.t, c.measured[:, i], color="black", lw=2.2, label="measured")
        axis.plot(
            c.t,
            c.identified[:, i],
            color=ACCENT,
            lw=1.2,
            label=f"identified, off by {_rms(c.identified, c, i):.3g} N·m rms",
        )
        axis.set_ylabel(f"{joint}\ntorque [N·m]")
        axis.legend(loc="upper left", bbox_to_anchor=(1.01, 1.0), frameon=False)
    axes[-1].set_xlabel("time [s]")
    finish(fig, path)


def _rms(predicted: Array, comparison: TorqueComparison, joint: int) -> float:
    return float(np.sqrt(np.mean((predicted[:, joint] - comparison.measured[:, joint]) ** 2)))
