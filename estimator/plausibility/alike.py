"""Whether recordings are of one arm in the same units: each is foretold by the given model as fitted to others.

Taken together, a recording in mN·m drowns the rest; taken alone, a short one may fit almost any other reading of its
channels. What others say of its torques does neither.
"""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.base_parameters import base_parameters
from estimator.plausibility.given_model import GivenModel, thinned
from estimator.plausibility.snapshot import Snapshot, joined, rms, take
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_ALIKE = 0.3
"""Correlation of a joint's torque with what is foretold, times the ratio of their sizes (below one). Recordings of the
stand-in's arms with large hidden effects, and of real ones, come down to 0.4; with a wrong sign it is negative, in
another order or unit it is near zero."""
_MATTERS = 0.1
"""Of the largest joint's: what is foretold for a joint below that is friction's prey."""
_TOLD = 0.3
"""Of what is foretold, its standard error: slow motions say nothing of the torques of fast ones."""
_LEAST_ROWS = 60


def contradicting(body: RigidBody, learnt: Sequence[Trajectory], judged: Sequence[Trajectory]) -> dict[int, list[str]]:
    """By their place in ``judged``, the recordings that contradict those learnt from, with the joints they do it at.

    A recording that is among those learnt from is held against the others. Nothing for a body without masses.
    """
    if not np.any(body.prior()[::10] > 0.0):
        return {}
    model = GivenModel(body, base_parameters(body))
    # Each by itself: smoothed as long recordings are, short ones beside them would have no rows.
    shots = {id(trajectory): take([trajectory]) for trajectory in (*learnt, *judged)}
    found = {}
    for number, trajectory in enumerate(judged):
        others = [shot for other in learnt if other is not trajectory and (shot := shots[id(other)]) is not None]
        own = shots[id(trajectory)]
        if own is None or not others:
            continue
        joints = _contradicted(model, thinned(joined(others)), own)
        if joints:
            found[number] = [body.joints[joint] for joint in joints]
    return found


def _contradicted(model: GivenModel, others: Snapshot, own: Snapshot) -> list[int]:
    told = model.foretold(others, own)
    if told is None:
        return []
    moving = {joint: one for joint, one in enumerate(told) if len(one.came)}
    pairs = {joint: (one.torque - np.mean(one.torque), one.came - np.mean(one.came)) for joint, one in moving.items()}
    largest = max((rms(foretold) for foretold, _ in pairs.values()), default=0.0)
    return [
        joint
        for joint, (foretold, came) in pairs.items()
        if len(came) >= _LEAST_ROWS
        and rms(foretold) > _MATTERS * largest
        and moving[joint].error < _TOLD * rms(foretold)
        and _agreement(foretold, came) < _ALIKE
    ]


def _agreement(foretold: Array, came: Array) -> float:
    a, b = float(np.linalg.norm(foretold)), float(np.linalg.norm(came))
    return float(foretold @ came) / max(a, b) ** 2 if max(a, b) > 0.0 else 1.0
