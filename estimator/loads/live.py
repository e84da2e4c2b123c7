"""The load while the arm moves: samples as they come, made into rows of Eq. 3.12, into the recursive form (3.3.2)."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.filtering import plan_filter, smooth_motion
from estimator.loads.frame_motion import frame_motion
from estimator.loads.known import KnownLoads
from estimator.loads.parameters import Measured, RigidLoad
from estimator.loads.recursive import RecursiveLoad
from estimator.loads.wrench_regressor import wrench_regressor
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

_BAND, _FLAT = 5.0, 4.0
"""Hz of the rows, one every tenth of a second; and to how many times that the kinematics are flat."""
_FIRST_ROWS = 5
"""Rows whose scatter tells the sensor's noise."""
_COLOUR = 4.0
"""Neighbouring samples of a filtered sensor that count as one."""
_LEAST_NOISE = 1e-5
"""Of the sensor's range."""
_LONGEST_STEP = 1.5
"""Periods; more is a gap."""
_UNKNOWN = np.array([20.0, *[5.0] * 3, *[2.0] * 6])
"""kg, kg·m, kg·m²: standard deviations of a load that nothing is known of."""


class LiveLoad:
    """Recursive estimate of load and offsets, a filter's length (a fifth of a second) behind the samples.

    ``rate`` Hz of the samples; ``sensor_range`` (6,) N, N·m, within which the offsets may lie; ``known`` loads that it
    may be: as soon as the samples tell that it is one of them, that one is the prior (`estimator.loads.known`). The
    sensor's delay is not known here, so a finished recording tells more (`estimator.loads.identify_load`).
    """

    def __init__(
        self, body: RigidBody, frame: str, rate: float, sensor_range: Array, known: Sequence[RigidLoad] = ()
    ) -> None:
        self._body, self._frame, self._range = body, frame, np.asarray(sensor_range, dtype=float)
        self._known = KnownLoads(known)
        self._plan = plan_filter(rate, _BAND, flat=_FLAT)
        self._block = self._plan.stride * self._plan.decimation
        self._kept: list[Array] = []
        self._first: list[tuple[Array, Array, Array]] = []
        self._filter: RecursiveLoad | None = None
        self._squares, self._count = 0.0, 0

    def feed(self, t: Array, q: Array, dq: Array, wrench: Array, wrench_t: Array) -> None:
        """Samples in order: ``t`` (k,) s, ``q, dq`` (k, n), and the last ``wrench`` (k, 6) with when it was measured.

        A sample with a NaN, or time left out, begins anew; what was learnt before stays.
        """
        for row in np.column_stack([t, wrench_t, q, dq, wrench]):
            late = bool(self._kept) and row[0] - self._kept[-1][0] > _LONGEST_STEP / self._plan.rate
            if late or not np.isfinite(row).all():
                self._kept.clear()
            if np.isfinite(row).all():
                self._kept.append(row)
            if len(self._kept) == 2 * self._plan.edge + self._block:
                self._row(np.array(self._kept))
                del self._kept[: self._block]

    @property
    def weighed(self) -> RigidLoad | None:
        """By the samples alone, with errors widened by what the rows miss the model beyond noise; None before the
        first."""
        if self._filter is None:
            return None
        found = self._filter.load
        widened = max(1.0, self._squares / max(self._count, 1))
        return RigidLoad(found.parameters, found.covariance * widened)

    @property
    def load(self) -> RigidLoad | None:
        """As known now, of the name of the known load that it is; one that is none of them is called ``load``. None
        before the first samples."""
        weighed = self.weighed
        return None if weighed is None else self._known.as_prior_of(weighed) or weighed

    @property
    def recognised(self) -> str | None:
        """The name of the known load that it is; None where it is none of them, or not told yet."""
        weighed = self.weighed
        prior = None if weighed is None else self._known.as_prior_of(weighed)
        return None if prior is None else prior.name

    @property
    def mass(self) -> Measured | None:
        """kg; None where the motion has not told it yet: its error is no tenth of what it was beforehand."""
        load = self.load
        return None if load is None or load.covariance[0, 0] > 0.01 * _UNKNOWN[0] ** 2 else load.mass

    def _row(self, samples: Array) -> None:
        n, edge = self._body.n, self._plan.edge
        t, wrench_t = samples[:, 0], samples[:, 1]
        q, dq, wrench = samples[:, 2 : 2 + n], samples[:, 2 + n : 2 + 2 * n], samples[:, 2 + 2 * n :]
        smooth = smooth_motion(self._plan, q, dq, None)
        motion = frame_motion(self._body, self._frame, smooth.q, smooth.dq, smooth.ddq)
        new = np.append(True, np.diff(wrench_t) > 0.0)
        inside = t[edge : edge + self._block]
        seen = np.column_stack([np.interp(inside, wrench_t[new], channel[new]) for channel in wrench.T])
        middle = np.arange(self._block) - (self._block - 1) / 2.0
        bent = seen - seen.mean(axis=0) - np.outer(middle, middle @ seen / (middle @ middle))
        noise = np.std(bent, axis=0) * np.sqrt(_COLOUR / self._block)
        row = wrench_regressor(motion).mean(axis=0), seen.mean(axis=0), noise
        if self._filter is None:
            self._first.append(row)
            if len(self._first) == _FIRST_ROWS:
                self._begin()
        else:
            self._update(*row[:2])

    def _begin(self) -> None:
        noise = np.maximum(np.median([x[2] for x in self._first], axis=0), _LEAST_NOISE * self._range)
        unknown = RigidLoad(np.zeros(10), np.diag(_UNKNOWN**2))
        self._filter = RecursiveLoad(unknown, noise, offset_error=self._range)
        for regressor, wrench, _ in self._first:
            self._update(regressor, wrench)
        self._first.clear()

    def _update(self, regressor: Array, wrench: Array) -> None:
        assert self._filter is not None
        innovation = self._filter.update(regressor, wrench, self._block / self._plan.rate)
        self._squares += float(innovation @ innovation)
        self._count += len(innovation)
