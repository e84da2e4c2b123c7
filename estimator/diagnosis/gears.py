"""Causes in the gears, where a recording has the angles of the motors beside those behind the gears.

What the two angles differ by is compared with the torque that the gear carries: no model of the arm enters, and the
search is the same. A gear's elasticity shows there a hundred times larger than in the torques.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.convolution import convolve
from estimator.diagnosis.beside import at_channel, put_beside, residuals
from estimator.diagnosis.evidence.design import Design, Hypothesis, linkless_design
from estimator.diagnosis.evidence.gathered import Evidence, weighed
from estimator.diagnosis.gear_laws import gear_laws
from estimator.diagnosis.naming.judging import Judged, judge
from estimator.diagnosis.observed.grains import repeated_white
from estimator.diagnosis.observed.noise import ORDER
from estimator.diagnosis.observed.stretches import (
    KINEMATIC,
    Channel,
    Grid,
    Stretch,
    calm_motion,
    gapless,
    make_grid,
    told_by,
)
from estimator.diagnosis.observed.tolerance import timing_precision
from estimator.diagnosis.telling.answer import GEAR, Diagnosis
from estimator.effects import Scales, Signals
from estimator.filtering import plan_filter, resample
from estimator.repeats import find_repeats
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_RATIO = (0.8, 1.25)
"""Of the motor's travel to the joint's: outside, the motor's angle is not one at the joint."""


def with_gears(
    found: Diagnosis, body: RigidBody, trajectories: Sequence[Trajectory], motor_angles: Sequence[Array]
) -> Diagnosis:
    """The diagnosis of an arm with what lies in its gears.

    ``motor_angles``: of each trajectory (samples, n) the motors' angles at the joints (rad), all NaN where a joint has
    one encoder only; the trajectory's are those behind the gears. Findings in the gears have the channel `GEAR`.
    Where no joint moves at both, a note says so. Raises InputError when a motor's angle is not one at the joint.
    """
    if not _told(body, trajectories, motor_angles):
        return replace(found, notes=(*found.notes, "no joint moves at both of its encoders: no gear is judged"))
    judged = judge_gears(body, trajectories, motor_angles)
    return replace(put_beside(found, judged), gear_residual=residuals(judged))


def judge_gears(body: RigidBody, trajectories: Sequence[Trajectory], motor_angles: Sequence[Array]) -> Judged:
    """The causes in the gears alone, arguments and errors as for `with_gears`, and where no joint moves at both."""
    for trajectory, angles in zip(trajectories, motor_angles, strict=True):
        if angles.shape != trajectory.q.shape:
            raise InputError(
                trajectory.name,
                f"{angles.shape} angles of motors and {trajectory.q.shape} behind the gears",
                "give both of one motion",
            )
    told = _told(body, trajectories, motor_angles)
    if not told:
        raise InputError(trajectories[0].name, "no joint moves at both of its encoders", "record both, in motion")
    for trajectory, angles in zip(trajectories, motor_angles, strict=True):
        _at_the_joint(body, told, trajectory, angles)
    return at_channel(judge(_gathered(body, told, trajectories, motor_angles)), GEAR)


def _told(body: RigidBody, trajectories: Sequence[Trajectory], motor_angles: Sequence[Array]) -> list[int]:
    """The joints that move at both of their encoders, in every recording."""
    both = list(zip(trajectories, motor_angles, strict=True))
    return [joint for joint in range(body.n) if all(_moves(t.q[:, joint]) and _moves(a[:, joint]) for t, a in both)]


def _moves(angle: Array) -> bool:
    known = angle[np.isfinite(angle)]
    return bool(len(known) and known.max() > known.min())


def _at_the_joint(body: RigidBody, told: Sequence[int], trajectory: Trajectory, angles: Array) -> None:
    """Raises InputError where a motor's angle is in other units, or not divided by the gear's ratio."""
    for joint in told:
        known = np.isfinite(trajectory.q[:, joint] + angles[:, joint])
        behind, motor = trajectory.q[known, joint], angles[known, joint]
        behind, motor = behind - behind.mean(), motor - motor.mean()
        ratio = float(motor @ behind / (behind @ behind))
        if not _RATIO[0] < ratio < _RATIO[1]:
            raise InputError(
                trajectory.name,
                f"the motor of {body.joints[joint]} turns {ratio:.4g} times as far as its joint",
                "give the motor's angle at the joint: divided by the gear's ratio, in rad, with the joint's sign",
            )


def _gathered(
    body: RigidBody, told: Sequence[int], trajectories: Sequence[Trajectory], motor_angles: Sequence[Array]
) -> Evidence:
    grid = replace(make_grid(body, trajectories), channels=tuple(Channel("deflection", joint) for joint in told))
    pieces = told_by(_cut(body, grid, trajectories, motor_angles), trajectories[0].name)
    rate = min(trajectory.rate for trajectory in trajectories)
    repeats = find_repeats(trajectories)
    # Both encoders' counts play again where a motion repeats to less than one.
    apart = [np.nan_to_num(angles - t.q) for t, angles in zip(trajectories, motor_angles, strict=True)]
    counted = repeated_white(trajectories, repeats, apart, grid.band)[list(told)] * 2.0 * grid.band / rate
    unseen = np.zeros((len(told), ORDER + 1))
    unseen[:, 0] = counted
    slow = partial(_cut, body, grid.slower(), trajectories, motor_angles)
    return weighed(_design(body, told, grid, pieces, rate), grid, pieces, slow, unseen, len(trajectories), repeats)


def _design(body: RigidBody, told: Sequence[int], grid: Grid, pieces: Sequence[Stretch], rate: float) -> Design:
    hypotheses = [Hypothesis(law, place) for law in gear_laws(told) for place in law.places(body)]
    scales = Scales.of([piece.signals for piece in pieces], grid.band)
    return linkless_design(body, grid.channels, hypotheses, scales, timing_precision(grid.channels, rate))


def _cut(
    body: RigidBody, grid: Grid, trajectories: Sequence[Trajectory], motor_angles: Sequence[Array]
) -> list[Stretch]:
    return [
        piece
        for number, (trajectory, angles) in enumerate(zip(trajectories, motor_angles, strict=True))
        for piece in _stretches(body, grid, number, trajectory, angles)
    ]


def _stretches(body: RigidBody, grid: Grid, recording: int, trajectory: Trajectory, angles: Array) -> list[Stretch]:
    """Gapless pieces; the residual is what the motor's angle is ahead, less its mean."""
    plan = plan_filter(trajectory.rate, grid.band, flat=KINEMATIC)
    chosen = [channel.index for channel in grid.channels]
    ahead = angles[:, chosen] - trajectory.q[:, chosen]
    whole = replace(trajectory, tau=trajectory.tau + 0.0 * ahead.sum(axis=1, keepdims=True))
    result = []
    for piece in gapless(grid, plan, whole):
        t, thin = trajectory.t[piece], slice(None, None, plan.stride)
        residual = convolve(resample(t, ahead[piece], plan.rate), plan.smooth)[thin]
        residual = residual - residual.mean(axis=0)
        calm = calm_motion(grid, plan, resample(t, trajectory.q[piece], plan.rate))
        # As sharp as the deflection, for a friction turns over in it; its noise is not the deflection's.
        carried = convolve(resample(t, trajectory.tau[piece], plan.rate), plan.smooth)[thin]
        times = t[0] + (plan.edge + plan.stride * np.arange(len(residual))) / plan.rate
        signals = Signals(body, times, calm.q[thin], calm.dq[thin], calm.ddq[thin], carried)
        power = np.mean(residual**2, axis=0)
        result.append(Stretch(recording, signals, residual, np.zeros_like(residual), power))
    return result
