"""The free recording of the very motion that a loaded one repeats, brought to its times."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray
from scipy.signal import correlate

from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_SAME = 0.02
"""Rms difference of two paths, over the rms of the motion itself, up to which they are one motion."""
_COVERED = 0.9
"""Share of the loaded recording that the free one must cover."""
_MOST_RATE = 200.0
"""Hz at which the lag is looked for."""


@dataclass(frozen=True)
class FreeTwin:
    """A free recording and its ``lag`` s: what the loaded one does at t, the free one does at t + lag."""

    free: Trajectory
    lag: float

    @property
    def name(self) -> str:
        return self.free.name

    def on_times_of(self, loaded: Trajectory) -> Trajectory:
        """The free recording at the loaded one's times; NaN where it does not reach, or has none."""
        wanted = loaded.t + self.lag

        def at(channel: Array) -> Array:
            # A NaN sample makes both of its neighbours' interpolations NaN: nothing is bridged.
            columns = [np.interp(wanted, self.free.t, c, left=np.nan, right=np.nan) for c in channel.T]
            return np.array(columns).T

        dq = None if self.free.dq is None else at(self.free.dq)
        return Trajectory(loaded.t, at(self.free.q), at(self.free.tau), dq, name=self.free.name)

    def covered(self, loaded: Trajectory) -> Trajectory:
        """The loaded recording where the free one is whole too."""
        other = self.on_times_of(loaded)
        whole = _whole(other.q) & _whole(other.tau)
        return replace(loaded, tau=np.where(whole[:, None], loaded.tau, np.nan))


def free_twin(loaded: Trajectory, free: Sequence[Trajectory]) -> FreeTwin | None:
    """The free recording of the same motion that fits best, None when there is none."""
    best: tuple[float, FreeTwin] | None = None
    for trajectory in free:
        twin = FreeTwin(trajectory, _lag(loaded, trajectory))
        difference = _difference(loaded, twin)
        if difference < _SAME and (best is None or difference < best[0]):
            best = difference, twin
    return None if best is None else best[1]


def _lag(loaded: Trajectory, free: Trajectory) -> float:
    """By the correlation of both motions' velocities, on a grid of the loaded recording's rate."""
    rate = min(_MOST_RATE, loaded.rate)
    (mine, begin), (theirs, other) = _velocities(loaded, rate), _velocities(free, rate)
    correlation = sum(correlate(a, b) for a, b in zip(mine.T, theirs.T, strict=True))
    coarse = (len(theirs) - 1 - int(np.argmax(correlation))) / rate + other - begin
    # Both run on one cycle: the finest lag is a whole number of samples.
    step = 1.0 / loaded.rate
    fine = [coarse + k * step for k in range(-round(1.0 / rate / step), round(1.0 / rate / step) + 1)]
    return min(fine, key=lambda lag: _difference(loaded, FreeTwin(free, lag)))


def _velocities(trajectory: Trajectory, rate: float) -> tuple[Array, float]:
    good = _whole(trajectory.q)
    t, q = trajectory.t[good], trajectory.q[good]
    grid = np.arange(t[0], t[-1], 1.0 / rate)
    angles = np.array([np.interp(grid, t, column) for column in q.T]).T
    return np.gradient(angles, axis=0), float(t[0])


def _difference(loaded: Trajectory, twin: FreeTwin) -> float:
    """Rms difference of the paths over the rms of the motion; infinite when they overlap too little."""
    other = twin.on_times_of(loaded).q
    both = _whole(other) & _whole(loaded.q)
    if np.count_nonzero(both) < _COVERED * len(both):
        return float("inf")
    path = loaded.q[both] - loaded.q[both].mean(axis=0)
    return float(np.linalg.norm(other[both] - loaded.q[both]) / max(float(np.linalg.norm(path)), 1e-12))


def _whole(channel: Array) -> NDArray[np.bool_]:
    return np.asarray(np.isfinite(channel).all(axis=1))
