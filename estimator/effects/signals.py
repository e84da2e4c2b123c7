"""What a law may look at: the smoothed motion of one recording, the given model's torques, and their sizes."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from functools import cached_property
from typing import Any

import numpy as np
import pinocchio as pin
from numpy.typing import NDArray
from scipy.interpolate import CubicSpline

from estimator.effects.lateness import Lateness
from estimator.effects.second_order import second_order_lag
from estimator.kinematics import tip_jacobian, tip_positions
from estimator.regressor import inverse_dynamics, torque_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_AT_REST = 1e-6
"""rad/s, rad/s²: a joint that stands is taken to move as little, for laws are tried at shares of it."""
_LEAST_WARMING = 2.0
"""°C over which a joint must have been, for its temperature to tell anything."""
_OF_THE_MOTION = ("q", "dq", "ddq", "tau_rigid", "tau_beside")
_OF_ALL_SAMPLES = ("body", "t", "late", "recorded")
_THIN = 8
"""Samples of a motion for each of which one place is kept."""


@dataclass(frozen=True)
class Signals:
    """One gapless stretch of motion on a uniform grid; arrays are samples × joints in the order of ``body``.

    Kinematics are smoothed alike for all laws. What was not recorded is None. Of a motion that is only planned,
    `Signals.of_motion` gives what a model needs to predict its torque.
    """

    body: RigidBody
    """The given model; its inertial parameters are those of `RigidBody.prior`."""
    t: Array
    """(samples,) s since the recording's start, evenly spaced."""
    q: Array
    """rad"""
    dq: Array
    """rad/s"""
    ddq: Array
    """rad/s²"""
    tau_rigid: Array
    """N·m that the given model needs for this motion."""
    tau: Array | None = None
    """N·m measured at the joint, with the same smoothing as the motion."""
    dq_measured: Array | None = None
    """rad/s of a velocity sensor of its own; ``dq`` is always the slope of the angles."""
    temperature: Array | None = None
    """°C, NaN of joints whose temperature is not known"""
    wrench: Array | None = None
    """(samples, 6) N and N·m in the sensor's frame."""
    load_wrench: Array | None = None
    """(samples, 6) what the sensor should exert on the given load during this motion."""
    tau_beside: Array | None = None
    """(samples, n) N·m that motors give for causes that were found, beside the given model's."""
    late: Lateness | None = None
    """Of what was recorded, where the torques answer to another motion than that (`answering_to`)."""
    recorded: Signals | None = None
    """The motion as it was recorded, where that is another."""

    @classmethod
    def of_motion(cls, body: RigidBody, t: Array, q: Array, dq: Array, ddq: Array) -> Signals:
        """Of a planned motion."""
        return cls(body, t, q, dq, ddq, inverse_dynamics(body, body.prior(), q, dq, ddq))

    def part(self, span: slice, t: Array) -> Signals:
        """Some neighbouring samples of it, at other times ``t`` s; what was worked out of the motion is kept."""
        channels = {f.name: getattr(self, f.name) for f in fields(self) if f.name not in _OF_ALL_SAMPLES}
        result = replace(self, t=t, **{name: x[span] for name, x in channels.items() if x is not None})
        if self.recorded is not None:
            result = replace(result, recorded=self.recorded.part(span, t))
        if "regressor" in self.__dict__:
            result.__dict__["regressor"] = self.regressor[span]
        if "sensitivity" in self.__dict__:
            result.__dict__["sensitivity"] = tuple(x[span] for x in self.sensitivity)
        return result

    def answering_to(self, late: Lateness) -> Signals:
        """The motion that torques answer to which are recorded so, for all laws of torques: each joint's so much
        earlier. What is compared with the motion itself, as a velocity, finds that in `recorded`."""
        told = {name: x for name in _OF_THE_MOTION if (x := getattr(self, name)) is not None}
        moved: dict[str, Any] = {name: self._earlier(x, late.delay) for name, x in told.items()}
        return replace(self, **moved, late=late, recorded=self)

    def _earlier(self, channel: Array, by: Array) -> Array:
        """A channel (samples, n), each joint's so many s (n,) earlier."""
        result = channel.copy()
        for late in np.unique(by[by != 0.0]):
            joints = np.flatnonzero(by == late)
            result[:, joints] = CubicSpline(self.t, channel[:, joints])(self.t - late)
        return result

    def lagged(self, x: Array) -> Array:
        """Torques (samples, …) as they are recorded: through the lag that is before them."""
        return x if self.late is None or self.late.lag is None else second_order_lag(x, self.period, *self.late.lag)

    @property
    def as_recorded(self) -> Signals:
        """The motion as it was recorded."""
        return self if self.recorded is None else self.recorded

    @cached_property
    def in_time(self) -> Signals:
        """The motion as it was recorded, but for single joints' angles that were late, and the torques that the given
        model needs for it."""
        told = self.as_recorded
        if self.late is None or not self.late.angles.any():
            return told
        motion = (told._earlier(channel, -self.late.angles) for channel in (told.q, told.dq, told.ddq))
        return Signals.of_motion(self.body, self.t, *motion)

    @property
    def samples(self) -> int:
        return len(self.t)

    @property
    def period(self) -> float:
        """s between samples."""
        return float(self.t[-1] - self.t[0]) / (len(self.t) - 1)

    @property
    def torque(self) -> Array:
        """N·m: as measured, else the given model's."""
        return self.tau_rigid if self.tau is None else self.tau

    @property
    def tau_motor(self) -> Array:
        """N·m that the motors give: the given model's torque, and what other causes were found to take."""
        return self.tau_rigid if self.tau_beside is None else self.tau_rigid + self.tau_beside

    def slope(self, x: Array) -> Array:
        """Time derivative of a smooth channel (samples, …), of fourth order."""
        h = self.period
        result = np.gradient(x, h, axis=0)
        result[2:-2] = (x[:-4] - x[4:] + 8.0 * (x[3:-1] - x[1:-3])) / (12.0 * h)
        return np.asarray(result)

    def direction(self, joint: int, width: float) -> Array:
        """(samples,) `averaged_sign` of a joint's speed."""
        return averaged_sign(self.dq[:, joint], width)

    @cached_property
    def regressor(self) -> Array:
        """(samples, n, 10·n) the torque regressor of the motion."""
        return torque_regressor(self.body, self.q, self.dq, self.ddq)

    @cached_property
    def distinguishable(self) -> NDArray[np.bool_]:
        """(n, 10) which parameters of each link have torques of their own in some motion, each judged against those
        before it."""
        n, random = self.body.n, np.random.default_rng(0)
        q, dq, ddq = random.normal(0.0, 2.0, (3, 20, n))
        columns = torque_regressor(self.body, q, dq, ddq).reshape(-1, n, 10).swapaxes(0, 1)
        upper = np.abs(np.diagonal(np.linalg.qr(columns, mode="r"), axis1=1, axis2=2))
        return np.asarray(upper > 1e-9 * np.linalg.norm(columns, axis=(1, 2))[:, None])

    @cached_property
    def sensitivity(self) -> tuple[Array, Array, Array]:
        """∂tau_rigid/∂q, ∂tau_rigid/∂dq, ∂tau_rigid/∂ddq (the mass matrix): (samples, n, n) each, [:, i, j] torque i by
        joint j. How an error of a sensor enters the torque equation."""
        n = self.body.n
        model = self.body.model
        data = model.createData()
        result = np.empty((3, self.samples, n, n))
        configuration = self.body.configuration
        for k in range(self.samples):
            pin.computeRNEADerivatives(model, data, configuration(self.q[k]), self.dq[k], self.ddq[k])
            result[0, k], result[1, k] = data.dtau_dq, data.dtau_dv
            result[2, k] = data.M
        # pinocchio fills the upper triangle of the mass matrix.
        upper = np.triu(np.ones((n, n), dtype=bool))
        inertia = np.where(upper, result[2], result[2].transpose(0, 2, 1))
        return result[0], result[1], inertia

    def gravity_torque(self, gravity: Array) -> Array:
        """(samples, n) N·m that hold the given model against a gravity (3,) m/s² of the base's frame."""
        still = np.zeros_like(self.q)
        body = replace(self.body, gravity=gravity)
        return inverse_dynamics(body, self.body.prior(), self.q, still, still)

    @cached_property
    def reach(self) -> Array:
        """(samples, n, 3) N·m of each joint for a unit force of the arm on the world, along x, y, z of the base, at the
        origin of the last link's frame: its transposed Jacobian."""
        return tip_jacobian(self.body, self.q)

    @cached_property
    def tip(self) -> Array:
        """(samples, 3) m in the base's frame: where the origin of the last link's frame is."""
        return tip_positions(self.body, self.q)

    def by_angle_error(self, joint: int, error: Array) -> Array:
        """(samples, n): what the model's torque gains when the true angle of a joint is ``error`` (samples,) rad more
        than the measured one, with the speed and acceleration that come with it."""
        return self._by_small_difference(joint, *self._with_slopes(error))

    def by_large_angle_error(self, joint: int, error: Array) -> Array:
        """(samples, n) the same of an ``error`` of any size, of which `by_angle_error` is the first order."""
        return self._by_difference(joint, *self._with_slopes(error))

    def by_late_angle(self, joint: int, delay: float, small: bool = False) -> Array:
        """(samples, n) the same of an angle that was recorded ``delay`` s late; of a ``small`` one to the first order
        in how far the joint moves in that time, in a tenth of the time."""
        own = np.stack([self.q[:, joint], self.dq[:, joint], self.ddq[:, joint]], axis=1)
        difference = (CubicSpline(self.t, own)(self.t + delay) - own).T
        return self._by_small_difference(joint, *difference) if small else self._by_difference(joint, *difference)

    def _with_slopes(self, error: Array) -> tuple[Array, Array, Array]:
        speed = self.slope(error)
        return error, speed, self.slope(speed)

    def _by_small_difference(self, joint: int, q: Array, dq: Array, ddq: Array) -> Array:
        """(samples, n) by as much more (samples,) of a joint's motion, to the first order."""
        each = zip(self.sensitivity, (q, dq, ddq), strict=True)
        return np.asarray(sum(by[:, :, joint] * own[:, None] for by, own in each))

    def _by_difference(self, joint: int, q: Array, dq: Array, ddq: Array) -> Array:
        true = [self.q.copy(), self.dq.copy(), self.ddq.copy()]
        for channel, own in zip(true, (q, dq, ddq), strict=True):
            channel[:, joint] += own
        return inverse_dynamics(self.body, self.body.prior(), *true) - self.tau_rigid


@dataclass(frozen=True)
class Scales:
    """How large the motion is, over all recordings that are diagnosed together: what bounds and grids are scaled by.

    Arrays are (n,).
    """

    q_low: Array
    q_high: Array
    dq: Array
    """rms, rad/s"""
    ddq: Array
    """rms, rad/s²"""
    tau: Array
    """rms of the measured torque, N·m"""
    duration: float
    """s of the longest recording"""
    band: float
    """Hz up to which torques are compared"""
    tip: Array
    """(places, 3) m that the origin of the last link's frame comes to"""
    cold: Array
    warm: Array
    """(n,) °C; NaN of joints whose temperature some stretch does not tell"""
    links: Array
    """(n, 10) inertial parameters of the given model"""

    def warms(self, joint: int) -> bool:
        """Whether the joint's temperature is known, and changes."""
        return bool(self.warm[joint] - self.cold[joint] > _LEAST_WARMING)

    @classmethod
    def of(cls, pieces: Sequence[Signals], band: float) -> Scales:
        """Of the stretches that will be compared."""

        def rms(channels: Sequence[Array]) -> Array:
            stacked = np.concatenate(channels)
            return np.asarray(np.sqrt(np.mean(stacked**2, axis=0)))

        q = np.concatenate([piece.q for piece in pieces])
        temperature = np.concatenate(
            [np.full_like(p.q, np.nan) if p.temperature is None else p.temperature for p in pieces]
        )
        return cls(
            q_low=q.min(axis=0),
            q_high=q.max(axis=0),
            dq=np.maximum(rms([piece.dq for piece in pieces]), _AT_REST),
            ddq=np.maximum(rms([piece.ddq for piece in pieces]), _AT_REST),
            tau=rms([piece.torque for piece in pieces]),
            duration=max(float(piece.t[-1]) for piece in pieces),
            band=band,
            tip=np.concatenate([piece.tip[::_THIN] for piece in pieces]),
            cold=temperature.min(axis=0),
            warm=temperature.max(axis=0),
            links=pieces[0].body.prior().reshape(-1, 10),
        )


def averaged_sign(x: Array, width: float) -> Array:
    """(samples,) tanh(x/width), averaged over each sample's own interval: a sign that changes between two samples
    keeps its area, so nothing depends on where the samples fall."""
    share = x / width
    middle = (share[1:] + share[:-1]) / 2.0
    edges = np.concatenate([[1.5 * share[0] - 0.5 * share[1]], middle, [1.5 * share[-1] - 0.5 * share[-2]]])
    area = np.logaddexp(edges, -edges)
    step = np.diff(edges)
    still = np.abs(step) < 1e-6
    mean = np.diff(area) / np.where(still, 1.0, step)
    return np.asarray(np.where(still, np.tanh(share), mean))
