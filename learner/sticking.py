"""What dry friction does to a motion that begins at rest: how far from its start it holds a joint, and what that costs.

A servo without an integrator moves nothing against friction: a joint that comes to its start stays where the servo's
torque is no more than the friction's level F, up to F/K from it. Let go when the motion begins, it is driven back by
the servo, whose damping takes up what its stiffness held, ∫D·δdq² dt = ½K·(F/K)², whatever the inertia is.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from learner.feedback_loop import FeedbackLoop
from learner.inverse_model import InverseModel
from learner.rests import speed_weight
from learner.trial import Reference

Array = NDArray[np.float64]


@dataclass(frozen=True)
class Sticking:
    """By the model, before anything moves; (n,) each, zero for a joint without dry friction or without a motion."""

    friction: Array
    """N·m: the level F at which friction holds a joint that is slow."""
    band: Array
    """rad: F/K, the farthest from its start that a joint may rest."""
    held: Array
    """s from the motion's begin until a joint at the far side lets go: friction's own feedforward takes half of the way
    from −F to F, and the motion's demand has to grow by the other half."""
    velocity_error: Array
    """rad/s, RMS over the motion: what coming from ``band`` to the reference adds to the first trial's error, at least;
    the motion going on while a joint is held adds up to half as much."""


def sticking(model: InverseModel, sliding: InverseModel, reference: Reference, loop: FeedbackLoop) -> Sticking:
    """Of the first trial by ``model``; ``sliding`` is the same without dry friction."""
    motion = (reference.q, reference.dq, reference.ddq)
    demand = sliding.torque(*motion)
    dry = np.abs(model.torque(*motion) - demand)[reference.moving]
    slow = speed_weight(reference)[reference.moving] < 1.0
    friction = np.max(np.where(slow, dry, 0.0), axis=0)
    start, stop, _ = reference.moving.indices(reference.samples)
    grown = demand - demand[start] + loop.stiffness * (reference.q - reference.q[start]) + loop.damping * reference.dq
    over = np.abs(grown[start:stop]) >= friction
    # A joint that never lets go is held throughout.
    held = np.where(over.any(axis=0), np.argmax(over, axis=0), stop - start) * reference.period
    lasts = (stop - start) * reference.period
    return Sticking(
        friction=friction,
        band=friction / loop.stiffness,
        held=np.where(friction > 0.0, held, 0.0),
        velocity_error=friction / np.sqrt(2.0 * loop.stiffness * loop.damping * lasts),
    )
