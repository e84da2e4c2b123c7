"""Angle, velocity, acceleration at the instants at which torques act, of data and reference alike.

Smoothing takes something off the motion itself. What is done to the data is therefore done to the reference too:
in the difference of the two the loss cancels (Section 6.4).
"""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.convolution import convolve
from estimator.filtering import FLAT_TO_BAND, FilterPlan, plan_filter

Array = NDArray[np.float64]
Motion = tuple[Array, Array, Array]


class Kinematics:
    """``flat_hz``: the zero-phase low-pass is flat up to it and closed at twice that; None leaves samples as they are.

    ``held``: torques are held over a sample, so motion is taken at mid-sample: the mean of neighbours, and their
    difference in velocity over the period, which is the mean acceleration exactly. Otherwise at the samples.
    """

    def __init__(self, period: float, *, held: bool, flat_hz: float | None) -> None:
        self.period, self.held = period, held
        self._plan: FilterPlan | None = None if flat_hz is None else plan_filter(1.0 / period, flat_hz / FLAT_TO_BAND)

    def at_torques(self, q: Array, dq: Array) -> Motion:
        """(q, dq, ddq), samples × n, from angles and velocities of the same shape that begin and end at rest."""
        if self._plan is None:
            smooth_q, smooth_dq = q, dq
            ddq = np.gradient(dq, self.period, axis=0)
        else:
            edge = ((self._plan.edge, self._plan.edge), (0, 0))
            far_q = np.pad(q, edge, mode="reflect", reflect_type="odd")
            far_dq = np.pad(dq, edge, mode="reflect")
            smooth_q, smooth_dq = convolve(far_q, self._plan.smooth), convolve(far_dq, self._plan.smooth)
            ddq = convolve(far_dq, self._plan.slope)
        if not self.held:
            return smooth_q, smooth_dq, ddq
        before_q, before_dq = (np.concatenate([x[:1], x[:-1]]) for x in (smooth_q, smooth_dq))
        return (smooth_q + before_q) / 2.0, (smooth_dq + before_dq) / 2.0, (smooth_dq - before_dq) / self.period
