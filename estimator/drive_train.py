"""What lies between a motor's torque and a torque sensor at the same joint: torque constant, friction, rotor.

The motor's torque, known from its current, also moves its rotor and overcomes the gear's friction; the sensor sees what
is left. No model of the arm is needed: g·tau_motor = tau_sensor + c·sign(dq) + b·dq + J·ddq + o.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.convolution import convolve
from estimator.filtering import plan_filter, resample, smooth_motion
from estimator.standstill import rest_speeds
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_BAND = 0.5
"""Hz of the smoothing, which is flat to six times this: motor, sensor and motion alike."""
_WIDTH = 0.01
"""rad/s (m/s) over which the sign of a speed turns."""
_BLOCK_S = 0.5
"""Blocks that are left out in turn: longer than what is left over stays alike."""
_FEWEST_BLOCKS = 4
_TOLD = 3.0
"""Standard errors by which a value must stand out of zero, or a gain be known, to be told."""


@dataclass(frozen=True)
class Estimate:
    """A value with its standard error; ``told``: whether the recordings tell it."""

    value: float
    standard_error: float
    told: bool


@dataclass(frozen=True)
class DriveTrain:
    """Of one joint, in the units of the catalogue: –, N·m, N·m·s/rad, kg·m² (a sliding joint: –, N, N·s/m, kg)."""

    torque_constant: Estimate
    """gain g: sensor's torque over what the motor's current says, all else taken off; told when known to a third."""
    coulomb: Estimate
    viscous: Estimate
    rotor_inertia: Estimate
    left: float
    """Share of the motor's torque (without its mean) that stays unexplained."""


def drive_trains(motor: Sequence[Trajectory], sensor: Sequence[Trajectory]) -> list[DriveTrain | None]:
    """One a joint, None where the joint hardly moves or its sensor says nothing.

    ``motor`` and ``sensor``: the same recordings, with the torque of the motors and of the sensors. Standard errors are
    from leaving out one block of half a second after the other. Raises InputError when the two do not belong together.
    """
    for one, other in zip(motor, sensor, strict=True):
        if one.q.shape != other.q.shape or not np.array_equal(one.t, other.t):
            raise InputError(one.name, f"is not the recording {other.name}", "give both torques of one motion")
    limits = rest_speeds(motor)
    rows: list[list[Array]] = [[] for _ in limits]
    for one, other in zip(motor, sensor, strict=True):
        for joint, blocks in enumerate(_blocks(one, other, limits)):
            rows[joint] += blocks
    return [_fitted(blocks) for blocks in rows]


def _blocks(motor: Trajectory, sensor: Trajectory, limits: Array) -> list[list[Array]]:
    """For each joint blocks of rows [sensor, sign, dq, ddq, 1 | motor] where it moves."""
    plan = plan_filter(motor.rate, _BAND)
    result: list[list[Array]] = [[] for _ in limits]
    for piece in motor.segments(len(motor.t), 0):
        if len(piece) <= 2 * plan.edge + 1:
            continue
        t = motor.t[piece]
        moved = smooth_motion(plan, resample(t, motor.q[piece], plan.rate), None, None)
        driven, felt = (
            convolve(resample(t, torque[piece], plan.rate), plan.smooth) for torque in (motor.tau, sensor.tau)
        )
        count = max(1, round(len(driven) / (_BLOCK_S * plan.rate)))
        for joint, limit in enumerate(limits):
            dq = moved.dq[:, joint]
            columns = [
                felt[:, joint],
                np.tanh(dq / _WIDTH),
                dq,
                moved.ddq[:, joint],
                np.ones_like(dq),
                driven[:, joint],
            ]
            table = np.column_stack(columns)
            for block, moving in zip(
                np.array_split(table, count), np.array_split(np.abs(dq) > limit, count), strict=True
            ):
                if moving.any():
                    result[joint].append(block[moving])
    return result


def _fitted(blocks: Sequence[Array]) -> DriveTrain | None:
    if len(blocks) < _FEWEST_BLOCKS or np.ptp(np.concatenate(blocks)[:, 0]) == 0.0:
        return None
    grams = np.array([block.T @ block for block in blocks])
    whole = grams.sum(axis=0)
    values = _values(whole)
    without = np.array([_values(whole - gram) for gram in grams])
    share = (len(blocks) - 1) / len(blocks)
    errors = np.sqrt(share * np.sum((without - without.mean(axis=0)) ** 2, axis=0))
    gain, coulomb, viscous, rotor = (
        Estimate(float(v), float(e), bool(abs(v) > _TOLD * e)) for v, e in zip(values, errors, strict=True)
    )
    return DriveTrain(gain, coulomb, viscous, rotor, _left(whole, np.concatenate(blocks)))


def _solved(gram: Array) -> Array:
    scale = np.sqrt(np.maximum(np.diag(gram), 1e-300))
    unit = gram / np.outer(scale, scale)
    solution = np.linalg.lstsq(unit[:-1, :-1], unit[:-1, -1], rcond=1e-9)[0]
    return np.asarray(solution * scale[-1] / scale[:-1])


def _values(gram: Array) -> Array:
    """(4,) gain, Coulomb and viscous friction, rotor inertia."""
    felt, sign, speed, bend, _ = _solved(gram)
    return np.asarray(np.array([1.0, sign, speed, bend]) / felt, dtype=np.float64)


def _left(gram: Array, rows: Array) -> float:
    residual = rows[:, -1] - rows[:, :-1] @ _solved(gram)
    return float(np.std(residual)) / max(float(np.std(rows[:, -1])), 1e-12)
