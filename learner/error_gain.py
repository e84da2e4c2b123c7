"""Λ, the gain from one trial's command error to the next one's, by frequency along the motion (Eq. 6.28)."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.linearisation import LinearArm

Array = NDArray[np.float64]
Complex = NDArray[np.complex128]


@dataclass(frozen=True)
class Tolerance:
    """What the model may be wrong by; the worst of the arms within counts.

    An inertia wrong by the share δ makes |Λ| about δ; a delay τ that is not in the model lifts |Λ| over 1 above
    about 1/(6τ): it is what caps the band in which practice can help.
    """

    inertia: float = 0.0
    """Share of the inertia matrix, either way."""
    delay_s: float = 0.0
    """By which what is learnt from is late. (What the servo itself feels late is in its loop already.)"""


def error_gain(
    arm: LinearArm, loop: FeedbackLoop, operator: Complex, frequencies: Array, tolerance: Tolerance | None = None
) -> Array:
    """Spectral radius of Λ = (1 − L·P)·(1 + C·P)⁻¹ at each frequency [Hz] and instant of the motion.

    ``operator``: L (frequencies, instants, n, 2n), see `LearningOperator.response`. Returns (frequencies, instants).
    The spectral radius, because it does not depend on the units or sizes of the joints' torques.
    """
    tolerance = tolerance or Tolerance()
    worst = np.zeros((len(frequencies), len(arm.inertia)))
    late = operator * np.exp(-2j * np.pi * frequencies * tolerance.delay_s)[:, None, None, None]
    # The corners of what is tolerated: within, every arm does better than at one of them.
    for share in {tolerance.inertia, -tolerance.inertia}:
        plant = _plant(arm.heavier(share), loop.period, frequencies)
        worst = np.maximum(worst, _radius(plant, loop, late, frequencies))
    return worst


def _plant(arm: LinearArm, period: float, frequencies: Array) -> Complex:
    """P of y = P·u: (frequencies, instants, 2n, n)."""
    a, b = arm.sampled(period)
    back = np.exp(-2j * np.pi * frequencies * period)[:, None, None, None]
    driven = np.broadcast_to(b + 0j, (len(frequencies), *b.shape))
    return np.asarray(np.linalg.solve(np.eye(a.shape[-1]) - back * a, driven))


def _radius(plant: Complex, loop: FeedbackLoop, operator: Complex, frequencies: Array) -> Array:
    identity = np.eye(plant.shape[-1])
    closed = identity + loop.response(frequencies)[:, None] @ plant
    # (1 − L·P)·closed⁻¹ and closed⁻¹·(1 − L·P) are similar: the same eigenvalues.
    propagation = np.linalg.solve(closed, identity - operator @ plant)
    return np.asarray(np.abs(np.linalg.eigvals(propagation)).max(axis=-1))
