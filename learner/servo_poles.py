"""Whether the servo holds the arm by itself: the poles of the closed loop at instants of a motion.

Practice begins with a loop that is stable. A model whose links are far lighter than the arm's, such as a URDF that
knows nothing of rotors behind gears, has none with that arm's servo, and can certify nothing.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from learner.feedback_loop import FeedbackLoop
from learner.linearisation import LinearArm


@dataclass(frozen=True)
class Swinging:
    """The fastest growing pole outside the unit circle: ``joint`` moves most in it."""

    instant: int
    joint: int
    frequency: float
    """Hz."""
    growth: float
    """Times a sample."""


def swinging(arm: LinearArm, loop: FeedbackLoop) -> Swinging | None:
    """The arm at each instant under its servo, as y[k] = A·y[k−1] − B·C·y[k−delay]; None when all poles decay."""
    a, b = arm.sampled(loop.period)
    points, states = a.shape[:2]
    size = states * loop.delay
    closed = np.zeros((points, size, size))
    closed[:, states:, :-states] = np.eye(size - states)
    closed[:, :states, :states] = a
    closed[:, :states, -states:] -= b @ loop.gains
    poles, vectors = np.linalg.eig(closed)
    instant, mode = np.unravel_index(np.argmax(np.abs(poles)), poles.shape)
    pole = poles[instant, mode]
    if abs(pole) < 1.0:
        return None
    joint = int(np.argmax(np.abs(vectors[instant, : arm.n, mode])))
    return Swinging(int(instant), joint, float(abs(np.angle(pole)) / (2 * np.pi * loop.period)), float(abs(pole)))
