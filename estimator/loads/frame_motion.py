"""Motion of the wrist sensor's frame, of many samples at once: what Eq. 3.12 needs of the arm's kinematics."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from config import InputError
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]


@dataclass(frozen=True)
class FrameMotion:
    """All (samples, 3), in the moving frame's own coordinates (superscript p in the thesis' section 3.7)."""

    w: Array
    """Angular velocity, rad/s."""
    dw: Array
    """Angular acceleration, rad/s²."""
    v: Array
    """Velocity of the origin, m/s."""
    a: Array
    """Acceleration of the origin less gravity, m/s²: what an accelerometer there would read."""
    g: Array
    """Gravity, m/s²."""

    def __len__(self) -> int:
        return len(self.w)


@dataclass(frozen=True)
class SensorFrame:
    """Where a frame of the URDF sits: on which joint of the body (−1: the base), and how."""

    joint: int
    rotation: Array
    """(3, 3) from the frame to the joint's link."""
    translation: Array
    """(3,) m, in the link's frame."""


def sensor_frame(body: RigidBody, frame: str) -> SensorFrame:
    """The frame of this name.

    Raises InputError when the URDF has no such link or joint.
    """
    names = [f.name for f in body.model.frames]
    if frame not in names:
        raise InputError("URDF", f"has no frame {frame!r}", f"its frames are {', '.join(names[1:])}")
    # A joint and its child link may share a name; they then share the place as well.
    found = body.model.frames[names.index(frame)]
    parent = found.parentJoint if hasattr(found, "parentJoint") else found.parent
    placement = found.placement
    return SensorFrame(int(parent) - 1, np.array(placement.rotation), np.array(placement.translation))


def frame_motion(body: RigidBody, frame: str, q: Array, dq: Array, ddq: Array) -> FrameMotion:
    """Outward recursion of Luh, Walker and Paul (1980) up to ``frame``, a link of the URDF.

    ``q, dq, ddq``: (samples, n) in rad, rad/s, rad/s² (m for sliding joints). Raises InputError for an unknown frame.
    """
    place = sensor_frame(body, frame)
    q, dq, ddq = (np.asarray(x, dtype=float) for x in (q, dq, ddq))
    still = np.zeros((len(q), 3))
    w, dw, v, g = still, still, still, np.broadcast_to(body.gravity, (len(q), 3))
    a = -g
    for joint in body.ancestors(place.joint):
        axis = body.axes[joint]
        speed, acceleration = dq[:, joint, None], ddq[:, joint, None]
        if axis.revolute:
            rotation, arm = axis.rotation @ _turns(axis.direction, q[:, joint]), axis.translation
        else:
            rotation = np.broadcast_to(axis.rotation, (len(q), 3, 3))
            arm = axis.translation + q[:, joint, None] * (axis.rotation @ axis.direction)
        w, dw, v, a, g = _carried(rotation, arm, w, dw, v, a, g)
        spin = np.cross(w, axis.direction)
        if axis.revolute:
            dw = dw + spin * speed + axis.direction * acceleration
            w = w + axis.direction * speed
        else:
            v = v + axis.direction * speed
            a = a + 2.0 * spin * speed + axis.direction * acceleration
    rotation = np.broadcast_to(place.rotation, (len(q), 3, 3))
    w, dw, v, a, g = _carried(rotation, place.translation, w, dw, v, a, g)
    return FrameMotion(w, dw, v, a, g)


def _carried(
    rotation: Array, arm: Array, w: Array, dw: Array, v: Array, a: Array, g: Array
) -> tuple[Array, Array, Array, Array, Array]:
    """The same body's motion at a point ``arm`` away, in axes turned by ``rotation`` (samples, 3, 3)."""
    v = v + np.cross(w, arm)
    a = a + np.cross(dw, arm) + np.cross(w, np.cross(w, arm))
    w, dw, v, a, g = (np.einsum("sij,si->sj", rotation, x) for x in (w, dw, v, a, g))
    return w, dw, v, a, g


def _turns(direction: Array, angle: Array) -> Array:
    """(samples, 3, 3) rotations about a unit vector (Rodrigues)."""
    x, y, z = direction
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    c, s = np.cos(angle)[:, None, None], np.sin(angle)[:, None, None]
    return np.asarray(np.eye(3) + s * skew + (1.0 - c) * (skew @ skew))
