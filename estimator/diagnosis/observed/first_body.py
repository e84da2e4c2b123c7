"""A model that has kinematics alone: the body that fits the recordings stands in for it.

How an elastic joint, a late channel or a weak motor shows depends on what the links weigh. Where the given model has no
mass at all, its links are free unknowns anyway; the laws are then those of the body that the recordings tell.
"""

from __future__ import annotations

from collections.abc import Sequence

from estimator.links import LinkOptions, identify_links
from estimator.rigid_body import RigidBody
from estimator.trajectory import Trajectory


def has_bodies(body: RigidBody) -> bool:
    """Whether any link of the model has a mass."""
    return bool((body.prior()[::10] > 0.0).any())


def first_body(body: RigidBody, trajectories: Sequence[Trajectory]) -> RigidBody:
    """The body itself where it has masses, else the one with the base parameters that least squares give, friction,
    rotors and offsets beside them. It fits torques, and is no promise of possible bodies.

    Raises InputError when the recordings do not tell any.
    """
    if has_bodies(body):
        return body
    found = identify_links(body, trajectories, LinkOptions(estimator="weighted"))
    return found.identified_body()
