"""Where the arm is in space, of many samples at once."""

from __future__ import annotations

import numpy as np
from numpy.typing import NDArray

from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


def tip_positions(body: RigidBody, q: Array) -> Array:
    """(samples, 3) m in the base's frame: the origin of the last link's frame in poses ``q`` (samples, n)."""
    position, link = np.zeros((len(q), 3)), body.n - 1
    while link >= 0:
        axis, own = body.axes[link], q[:, [link]]
        moved = _turned(position, axis.direction, own) if axis.revolute else position + own * axis.direction
        position = axis.translation + moved @ axis.rotation.T
        link = axis.parent
    return position


def _turned(x: Array, about: Array, angle: Array) -> Array:
    """(samples, 3) turned about a unit vector by (samples, 1) rad (Rodrigues)."""
    along = (x @ about)[:, None] * about
    return np.asarray(along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(about, x))
