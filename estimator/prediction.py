"""Measured against predicted torque, over time: for plots, and for the raw error figure without any low-pass."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.convolution import convolve
from estimator.filtering import FLAT_TO_BAND, FilterPlan, plan_filter, resample, smooth_motion
from estimator.identification import LinkIdentification
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]


@dataclass(frozen=True)
class TorqueHistory:
    """Torques of one recording where it has no gaps: ``t`` (samples,) s, the others (samples, n) N·m."""

    t: Array
    measured: Array
    """As recorded, not filtered."""
    predicted: Array
    """Of the motion, below the estimate's band: what lies above is the noise of differentiated angles."""

    @property
    def relative_error(self) -> float:
        """100·‖measured − predicted‖/‖measured‖ over all joints, percent."""
        return 100.0 * float(np.linalg.norm(self.measured - self.predicted) / np.linalg.norm(self.measured))


def torque_history(found: LinkIdentification, trajectory: Trajectory) -> TorqueHistory:
    """What an identified arm should have needed for a recorded motion, beside what it needed."""
    body = found.body
    psi = found.base.representative(found.beta)

    def predict(dq: Array, ddq: Array) -> Array:
        extra = np.zeros_like(dq)
        for term, value in zip(found.terms, found.value[found.base.rank :], strict=True):
            extra[:, term.joint] += value * term.column(dq[:, term.joint], ddq[:, term.joint])
        return extra

    return _history(body, psi, trajectory, found.band, predict)


def model_torque_history(body: RigidBody, parameters: Array, trajectory: Trajectory, band: float) -> TorqueHistory:
    """The same for inertial parameters (10·n,) alone, such as `RigidBody.prior`'s; ``band`` Hz as in the estimate."""
    return _history(body, parameters, trajectory, band, lambda dq, _: np.zeros_like(dq))


def _history(
    body: RigidBody, psi: Array, trajectory: Trajectory, band: float, extra: Callable[[Array, Array], Array]
) -> TorqueHistory:
    plan = plan_filter(trajectory.rate, band)
    pieces = [
        _piece(body, psi, trajectory, piece, plan, extra)
        for piece in trajectory.segments(CHUNK, 2 * plan.edge)
        if len(piece) > 2 * plan.edge + 1
    ]
    if not pieces:
        raise InputError(
            trajectory.name, "has no gapless stretch long enough to predict torques", "record longer motion"
        )
    t, measured, predicted = (np.concatenate(x) for x in zip(*pieces, strict=True))
    return TorqueHistory(t, measured, predicted)


def _piece(
    body: RigidBody,
    psi: Array,
    trajectory: Trajectory,
    piece: NDArray[np.intp],
    plan: FilterPlan,
    extra: Callable[[Array, Array], Array],
) -> tuple[Array, Array, Array]:
    t = trajectory.t[piece]

    def grid(channel: Array | None) -> Array | None:
        return None if channel is None else resample(t, channel[piece], plan.rate)

    q = resample(t, trajectory.q[piece], plan.rate)
    motion = smooth_motion(plan, q, grid(trajectory.dq), grid(trajectory.ddq))
    tau = resample(t, trajectory.tau[piece], plan.rate)
    inner = slice(plan.edge, len(q) - plan.edge)
    predicted = _below(
        inverse_dynamics(body, psi, motion.q, motion.dq, motion.ddq) + extra(motion.dq, motion.ddq), plan
    )
    return t[0] + np.arange(len(q))[inner] / plan.rate, tau[inner], predicted


def _below(torque: Array, plan: FilterPlan) -> Array:
    """Zero-phase low-pass, flat to the band; the ends are continued by odd reflection."""
    kernel = plan_filter(plan.rate, plan.band / FLAT_TO_BAND).smooth
    reach = len(kernel) // 2
    padded = np.pad(torque, ((reach, reach), (0, 0)), mode="reflect", reflect_type="odd")
    return convolve(padded, kernel)
