"""Causes between the motors and the torque sensors behind their gears, where a recording has both torques.

The sensor takes the model's place: what a motor spends beside the torque that its joint's sensor reads is friction,
its rotor, its torque constant, its ripple. No model of the arm enters, and the search is the same.
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
from estimator.diagnosis.evidence.maps import MAPS
from estimator.diagnosis.naming.judging import Judged, judge
from estimator.diagnosis.observed.noise import ORDER
from estimator.diagnosis.observed.stretches import (
    KINEMATIC,
    Channel,
    Grid,
    Stretch,
    calm_motion,
    gapless,
    make_grid,
    temperatures_at,
    told_by,
)
from estimator.diagnosis.observed.tolerance import timing_precision
from estimator.diagnosis.telling.answer import MOTOR, Diagnosis
from estimator.effects import Place, Scales, Signals, catalogue
from estimator.filtering import plan_filter, resample
from estimator.repeats import find_repeats
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]


def with_drives(
    found: Diagnosis, body: RigidBody, motors: Sequence[Trajectory], sensors: Sequence[Trajectory]
) -> Diagnosis:
    """The diagnosis of an arm with what lies in its drives.

    ``motors`` and ``sensors``: the same recordings with the torques of the motors, at the joints (N·m), and of the
    joints' sensors. Findings in the drives have the channel `MOTOR`; their torque is the motor's. Raises InputError
    when no joint has both torques.
    """
    judged = judge_drives(body, motors, sensors)
    return replace(put_beside(found, judged), drive_residual=residuals(judged))


def judge_drives(body: RigidBody, motors: Sequence[Trajectory], sensors: Sequence[Trajectory]) -> Judged:
    """The causes in the drives alone, arguments and errors as for `with_drives`."""
    for one, other in zip(motors, sensors, strict=True):
        if one.q.shape != other.q.shape or not np.array_equal(one.t, other.t):
            raise InputError(one.name, f"is not the recording {other.name}", "give both torques of one motion")
    return at_channel(judge(_gathered(body, motors, sensors)), MOTOR)


def _gathered(body: RigidBody, motors: Sequence[Trajectory], sensors: Sequence[Trajectory]) -> Evidence:
    told = [
        joint
        for joint in range(body.n)
        if all(np.nanmax(t.tau[:, joint]) > np.nanmin(t.tau[:, joint]) for t in (*motors, *sensors))
    ]
    if not told:
        raise InputError(motors[0].name, "no joint has the torques of its motor and of its sensor", "record both")
    plain = make_grid(body, motors)
    grid = replace(plain, channels=tuple(Channel("torque", joint) for joint in told))
    pieces = told_by(_cut(body, grid, motors, sensors), motors[0].name)
    design = _design(body, grid, pieces, min(motor.rate for motor in motors))
    repeats = find_repeats(motors)
    unseen = np.zeros((len(told), ORDER + 1))
    slow = partial(_cut, body, grid.slower(), motors, sensors)
    return weighed(design, grid, pieces, slow, unseen, len(motors), repeats)


def _design(body: RigidBody, grid: Grid, pieces: Sequence[Stretch], rate: float) -> Design:
    laws = [law for effect in catalogue().values() for law in effect.laws() if law.in_drive]
    scales = Scales.of([piece.signals for piece in pieces], grid.band)
    hypotheses = [Hypothesis(law, place) for law in laws for place in law.places(body)]
    hypotheses += [Hypothesis(drawn, place) for drawn in MAPS for place in drawn.told_of(body, scales)]
    hypotheses.append(Hypothesis(catalogue()["transport_delay"], Place(channel="torque")))
    return linkless_design(body, grid.channels, hypotheses, scales, timing_precision(grid.channels, rate))


def _cut(body: RigidBody, grid: Grid, motors: Sequence[Trajectory], sensors: Sequence[Trajectory]) -> list[Stretch]:
    return [
        piece
        for number, (motor, sensor) in enumerate(zip(motors, sensors, strict=True))
        for piece in _stretches(body, grid, number, motor, sensor)
    ]


def _stretches(body: RigidBody, grid: Grid, recording: int, motor: Trajectory, sensor: Trajectory) -> list[Stretch]:
    """Gapless pieces; the residual is what the motor spends beside its sensor's torque."""
    plan = plan_filter(motor.rate, grid.band, flat=KINEMATIC)
    chosen = [channel.index for channel in grid.channels]
    both = replace(motor, tau=motor.tau + 0.0 * sensor.tau)
    result = []
    for piece in gapless(grid, plan, both):
        t, thin = motor.t[piece], slice(None, None, plan.stride)
        driven, felt = (resample(t, own.tau[piece], plan.rate) for own in (motor, sensor))
        calm = calm_motion(grid, plan, resample(t, motor.q[piece], plan.rate))
        # Noise of the sensor in a column would be the residual's own.
        through = calm_motion(grid, plan, felt).q[thin]
        residual = convolve(driven - felt, plan.smooth)[thin][:, chosen]
        times = t[0] + (plan.edge + plan.stride * np.arange(len(residual))) / plan.rate
        motion = calm.q[thin], calm.dq[thin], calm.ddq[thin]
        signals = Signals(body, times, *motion, through, temperature=temperatures_at(motor, times))
        power = np.mean(convolve(driven, plan.smooth)[:, chosen] ** 2, axis=0)
        result.append(Stretch(recording, signals, residual, np.zeros_like(residual), power))
    return result
