"""Mass and centre of a load from wrenches at rest in several poses (thesis, Eq. 3.19, 3.20)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.loads.frame_motion import frame_motion
from estimator.loads.parameters import RigidLoad
from estimator.loads.wrench_regressor import wrench_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StaticLoad:
    """``load``: mass and first moment, the inertia unknown; ``offset`` (6,) N, N·m, zeros when not fitted.

    ``residual`` (2,): rms N of the forces, N·m of the torques. ``degrees_of_freedom``: the smaller of both parts.
    """

    load: RigidLoad
    offset: Array
    residual: Array
    degrees_of_freedom: int


def identify_static_load(
    body: RigidBody, frame: str, q: Array, wrench: Array, hand: RigidLoad | None = None, with_offset: bool = True
) -> StaticLoad:
    """``q`` (poses, n) rad and the mean wrench (poses, 6) N, N·m at each, in ``frame`` of the URDF.

    Forces tell the mass and torques the first moment, each with the noise of its own residuals. The hand is
    subtracted. Raises InputError for too few poses, missing numbers, or poses between which gravity hardly turns.
    """
    q, wrench = np.asarray(q, dtype=float), np.asarray(wrench, dtype=float)
    if q.ndim != 2 or q.shape[1] != body.n or wrench.shape != (len(q), 6):
        raise InputError("poses", f"q has shape {q.shape}, the wrench {wrench.shape}", "give poses × joints, poses × 6")
    if not (np.isfinite(q).all() and np.isfinite(wrench).all()):
        raise InputError("poses", "an angle or a wrench is not a number", "leave incomplete poses out")
    still = np.zeros_like(q)
    regressor = wrench_regressor(frame_motion(body, frame, q, still, still))
    parameters, covariance = np.full(10, np.nan), np.full((10, 10), np.nan)
    covariance[range(10), range(10)] = np.inf
    offset, residual, free = np.zeros(6), np.zeros(2), []
    for part, (channels, mine) in enumerate(((slice(0, 3), slice(0, 1)), (slice(3, 6), slice(1, 4)))):
        count = mine.stop - mine.start
        columns = regressor[:, channels, mine].reshape(-1, count)
        if with_offset:
            columns = np.hstack([columns, np.tile(np.eye(3), (len(q), 1))])
        free.append(len(columns) - columns.shape[1])
        if free[-1] < 1 or np.linalg.cond(columns / np.linalg.norm(columns, axis=0)) > 1e4:
            raise InputError(
                "poses", f"{len(q)} poses with hardly any turn of gravity", "hold the load in six poses that differ"
            )
        measured = wrench[:, channels].reshape(-1)
        value, inverse = np.linalg.lstsq(columns, measured)[0], np.linalg.inv(columns.T @ columns)
        left = measured - columns @ value
        parameters[mine] = value[:count]
        covariance[mine, mine] = (left @ left / free[-1]) * inverse[:count, :count]
        residual[part] = np.sqrt(np.mean(left**2))
        if with_offset:
            offset[channels] = value[count:]
    # Forces and torques have noise of their own: mass and first moment do not err together.
    covariance[0, 1:4] = covariance[1:4, 0] = 0.0
    load = RigidLoad(parameters, covariance)
    return StaticLoad(load if hand is None else load.without(hand), offset, residual, min(free))
