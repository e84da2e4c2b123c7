"""Mass and centre of a load from wrenches at rest in several poses (thesis, Eq. 3.19, 3.20)."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import t as student

from config import InputError
from estimator.loads.entries import load_entries, load_warnings, plain
from estimator.loads.frame_motion import frame_motion
from estimator.loads.parameters import Measured, RigidLoad
from estimator.loads.poses import Poses
from estimator.loads.wrench_regressor import CHANNELS, wrench_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


@dataclass(frozen=True)
class StaticLoad:
    """``load``: mass and first moment, the inertia unknown; ``offset`` (6,) N, N·m at session time zero and ``drift``
    (6,) N/s, N·m/s, zeros where not fitted.

    ``left`` and ``measured`` (poses, 6): residuals and wrenches. ``degrees_of_freedom``: the smaller of both parts.
    """

    load: RigidLoad
    offset: Array
    drift: Array
    left: Array
    measured: Array
    degrees_of_freedom: int
    warnings: tuple[str, ...] = ()

    def interval(self, measured: Measured, level: float = 0.95) -> Array:
        """(…, 2) confidence interval of one of the load's quantities."""
        reach = measured.standard_error * student.isf((1.0 - level) / 2.0, self.degrees_of_freedom)
        return np.stack([measured.value - reach, measured.value + reach], axis=-1)

    def as_json(self) -> dict[str, Any]:
        """As `LoadEstimate.as_json`; what rest does not tell is null."""
        rms, power = (np.sqrt(np.mean(x**2, axis=0)) for x in (self.left, self.measured))
        return {
            **load_entries(self.load, held=False),
            "wrench_residual": {
                name: {"rms": float(r), "relative": float(r / p) if p > 0.0 else 0.0}
                for name, r, p in zip(CHANNELS, rms, power, strict=True)
            },
            "rigid": {"verdict": "untested", "p_value": None, "noise_from": "nothing", "detectable_share": None},
            "offset": {"value": plain(self.offset), "standard_error": None, "unit": "N, N·m"},
            "drift": {"value": plain(self.drift), "standard_error": None, "unit": "N/s, N·m/s"},
            "wrench_delay": None,
            "poses": len(self.measured),
            "form": "static",
            "status": "identified",
            "warnings": [*self.warnings, *(w for w in load_warnings(self.load) if "does not tell" not in w)],
        }


def identify_static_load(
    body: RigidBody,
    frame: str,
    poses: Poses,
    hand: RigidLoad | None = None,
    with_offset: bool = True,
    with_drift: bool = False,
) -> StaticLoad:
    """From the wrenches of ``poses``, in ``frame`` of the URDF.

    Forces tell the mass and torques the first moment, each with the noise of its own residuals. The hand is
    subtracted. ``with_drift``: the offsets change linearly over the poses. Raises InputError for too few poses,
    missing numbers, or poses between which gravity hardly turns.
    """
    q, wrench = poses.q, poses.wrench
    if q.ndim != 2 or q.shape[1] != body.n or wrench.shape != (len(q), 6):
        raise InputError("poses", f"q has shape {q.shape}, the wrench {wrench.shape}", "give poses × joints, poses × 6")
    if not (np.isfinite(q).all() and np.isfinite(wrench).all()):
        raise InputError("poses", "an angle or a wrench is not a number", "the static form needs all six channels")
    still = np.zeros_like(q)
    regressor = wrench_regressor(frame_motion(body, frame, q, still, still))
    parameters, covariance = np.full(10, np.nan), np.full((10, 10), np.nan)
    covariance[range(10), range(10)] = np.inf
    middle = float(poses.t.mean())
    sensor = [np.ones(len(q)), poses.t - middle][: (1 + with_drift) if with_offset else 0]
    extra = np.hstack([np.kron(column[:, None], np.eye(3)) for column in sensor] or [np.zeros((3 * len(q), 0))])
    offset, drift, left, free = np.zeros(6), np.zeros(6), np.zeros_like(wrench), []
    for channels, mine in ((slice(0, 3), slice(0, 1)), (slice(3, 6), slice(1, 4))):
        count = mine.stop - mine.start
        columns = np.hstack([regressor[:, channels, mine].reshape(-1, count), extra])
        free.append(len(columns) - columns.shape[1])
        if free[-1] < 1 or np.linalg.cond(columns / np.linalg.norm(columns, axis=0)) > 1e4:
            raise InputError(
                "poses", f"{len(q)} poses with hardly any turn of gravity", "hold the load in six poses that differ"
            )
        measured = wrench[:, channels].reshape(-1)
        value, inverse = np.linalg.lstsq(columns, measured)[0], np.linalg.inv(columns.T @ columns)
        rest = measured - columns @ value
        parameters[mine] = value[:count]
        covariance[mine, mine] = (rest @ rest / free[-1]) * inverse[:count, :count]
        left[:, channels] = rest.reshape(-1, 3)
        if with_offset:
            drift[channels] = value[count + 3 :] if with_drift else 0.0
            offset[channels] = value[count : count + 3] - middle * drift[channels]
    # Forces and torques have noise of their own: mass and first moment do not err together.
    covariance[0, 1:4] = covariance[1:4, 0] = 0.0
    load = RigidLoad(parameters, covariance)
    return StaticLoad(load if hand is None else load.without(hand), offset, drift, left, wrench, min(free))
