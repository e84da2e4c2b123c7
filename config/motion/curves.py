"""Joint-space curves with analytic derivatives. Time in s from 0 to ``duration_s``, angles in rad.

``evaluate(t)`` of each gives (q, dq, ddq), samples × joints; times outside the curve are held at its ends.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Protocol, TypeAlias

import numpy as np
from numpy.polynomial import Polynomial
from numpy.typing import NDArray
from scipy.interpolate import BSpline, make_interp_spline

Array: TypeAlias = NDArray[np.float64]
States: TypeAlias = tuple[Array, Array, Array]

REST_TO_REST = {
    5: Polynomial([0, 0, 0, 10, -15, 6]),
    7: Polynomial([0, 0, 0, 0, 35, -84, 70, -20]),
}
"""Shapes from 0 to 1 on 0 to 1 by order: velocity and acceleration vanish at the ends, at order 7 the jerk too."""


class Curve(Protocol):
    """A path in time of all joints."""

    @property
    def duration_s(self) -> float: ...

    def evaluate(self, t: Array) -> States: ...


class RestToRest:
    """Polynomial moves of one shape for all joints between way points, at rest ``dwell_s`` long at each inner one.

    ``waypoints``: points × joints in rad; ``durations_s``: one a move; ``order``: 5 or 7 (thesis, sections 4.4, 6.4).
    """

    def __init__(self, waypoints: Array, durations_s: Sequence[float], order: int, dwell_s: float = 0.0) -> None:
        self._waypoints = np.asarray(waypoints, dtype=float)
        self._durations = np.asarray(durations_s, dtype=float)
        self._shape = REST_TO_REST[order]
        steps = self._durations + dwell_s
        self._starts = np.concatenate(([0.0], np.cumsum(steps[:-1])))
        self.duration_s = float(self._starts[-1] + self._durations[-1])

    def evaluate(self, t: Array) -> States:
        """(q, dq, ddq) at ``t``."""
        k = np.clip(np.searchsorted(self._starts, t, side="right") - 1, 0, len(self._durations) - 1)
        duration = self._durations[k]
        u = np.clip((t - self._starts[k]) / duration, 0.0, 1.0)
        distance = self._waypoints[k + 1] - self._waypoints[k]
        speed, acceleration = self._shape.deriv(1), self._shape.deriv(2)
        return (
            self._waypoints[k] + self._shape(u)[:, None] * distance,
            (speed(u) / duration)[:, None] * distance,
            (acceleration(u) / duration**2)[:, None] * distance,
        )


class Spline:
    """Quintic spline through points, from rest to rest.

    With a knot at each point it has the least integral of squared jerk of all curves through them
    (Flash and Hogan 1985). ``times_s``: increasing, from 0; ``points``: points × joints in rad.
    """

    def __init__(self, times_s: Array, points: Array) -> None:
        at_rest = [(1, np.zeros(points.shape[1])), (2, np.zeros(points.shape[1]))]
        self._q: BSpline = make_interp_spline(times_s, points, k=5, bc_type=(at_rest, at_rest))  # type: ignore[arg-type]  # the stubs know one form only
        self._dq, self._ddq = self._q.derivative(1), self._q.derivative(2)
        self.duration_s = float(times_s[-1])

    def evaluate(self, t: Array) -> States:
        """(q, dq, ddq) at ``t``."""
        inside = np.clip(t, 0.0, self.duration_s)
        return self._q(inside), self._dq(inside), self._ddq(inside)


class Fourier:
    """Periodic motion about ``centre``, faded in and out over ``fade_s`` by the minimum-jerk shape.

    q = centre + Σₖ sineₖ·sin(kωt) + cosineₖ·cos(kωt) with ω = 2π·base_hz; ``centre``: joints;
    ``sine``, ``cosine``: harmonics × joints, in rad. Between rise and fall it is periodic, for ``full_s`` seconds.
    """

    def __init__(self, centre: Array, sine: Array, cosine: Array, base_hz: float, full_s: float, fade_s: float) -> None:
        self._centre, self._sine, self._cosine = centre, sine, cosine
        self._pulsations = 2 * np.pi * base_hz * np.arange(1, len(sine) + 1)
        self._fade = fade_s
        self.duration_s = full_s + 2 * fade_s

    def evaluate(self, t: Array) -> States:
        """(q, dq, ddq) at ``t``."""
        inside = np.clip(t, 0.0, self.duration_s)
        angle = np.multiply.outer(inside - self._fade, self._pulsations)
        sin, cos, w = np.sin(angle), np.cos(angle), self._pulsations
        p = sin @ self._sine + cos @ self._cosine
        dp = (w * cos) @ self._sine - (w * sin) @ self._cosine
        ddp = -(w**2 * sin) @ self._sine - (w**2 * cos) @ self._cosine
        s, ds, dds = (column[:, None] for column in self._envelope(inside))
        return self._centre + s * p, ds * p + s * dp, dds * p + 2 * ds * dp + s * ddp

    def _envelope(self, t: Array) -> States:
        shape = REST_TO_REST[5]
        up, down = t / self._fade, (self.duration_s - t) / self._fade
        u = np.clip(np.minimum(up, down), 0.0, 1.0)
        direction = np.where(up <= down, 1.0, -1.0)
        return shape(u), direction * shape.deriv(1)(u) / self._fade, shape.deriv(2)(u) / self._fade**2
