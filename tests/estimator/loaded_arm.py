"""A load in the tool's frame of an arm, as what it adds to the arm's inertial parameters."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator import RigidBody
from estimator.consistency import parameters_of, pseudo_inertia
from estimator.loads import RigidLoad
from estimator.loads.frame_motion import sensor_frame

Array = NDArray[np.float64]


def at_tool(body: RigidBody, load: RigidLoad) -> Array:
    """What ``load`` adds to the parameters (10 n) of ``body``: moved to its last link by its pseudo-inertia."""
    place = sensor_frame(body, "tool")
    rigid = np.eye(4)
    rigid[:3, :3], rigid[:3, 3] = place.rotation, place.translation
    added = np.zeros_like(body.prior())
    added[10 * place.joint : 10 * place.joint + 10] = parameters_of(rigid @ pseudo_inertia(load.parameters) @ rigid.T)
    return added
