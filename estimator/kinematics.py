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


def tip_jacobian(body: RigidBody, q: Array) -> Array:
    """(samples, n, 3) m/rad (of a sliding joint, none) in the base's frame: how the origin of the last link's frame
    moves with each joint, those that do not carry it leaving it where it is."""
    tip, result = tip_positions(body, q), np.zeros((len(q), body.n, 3))
    # What the base's unit vectors are in the frame of the link, and where its origin is.
    states: list[tuple[Array, Array]] = []
    carrying = {*body.ancestors(body.n - 1)}
    for link, axis in enumerate(body.axes):
        turn, origin = states[axis.parent] if axis.parent >= 0 else (np.broadcast_to(np.eye(3), (len(q), 3, 3)), 0.0)
        origin, turn = origin + turn @ axis.translation, turn @ axis.rotation
        way = turn @ axis.direction
        if link in carrying:
            result[:, link] = np.cross(way, tip - origin) if axis.revolute else way
        if axis.revolute:
            turn = np.stack([_turned(x, axis.direction, -q[:, [link]]) for x in turn.swapaxes(0, 1)], axis=1)
        else:
            origin = origin + q[:, [link]] * way
        states.append((turn, origin))
    return result


def _turned(x: Array, about: Array, angle: Array) -> Array:
    """(samples, 3) turned about a unit vector by (samples, 1) rad (Rodrigues)."""
    along = (x @ about)[:, None] * about
    return np.asarray(along + np.cos(angle) * (x - along) + np.sin(angle) * np.cross(about, x))
