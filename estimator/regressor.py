"""The torque regressor of many samples at once: tau = K(q, dq, ddq)·psi (thesis, Eq. 4.7).

A Newton–Euler recursion over links, each step of which is done for a whole block of samples. K_ij, the torque at
joint i by link j, is the power that the link's wrench A_j·phi_j does on a unit motion of joint i; that motion's
screw is carried outwards with the link's own velocity and acceleration, so no wrench is ever carried inwards.
Arrays keep the samples last: one arithmetic operation then serves the block from the cache.
"""

from __future__ import annotations

from collections.abc import Iterator

import numpy as np
from numpy.typing import NDArray

from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

BLOCK = 4096
"""Samples a block: enough that steps of Python cost little beside the arithmetic; K of six joints has 12 MB."""


def torque_regressor(body: RigidBody, q: Array, dq: Array, ddq: Array) -> Array:
    """Regressor of every sample.

    ``q, dq, ddq``: (samples, n) in rad, rad/s, rad/s² (m for sliding joints).
    Returns (samples, n, 10·n), N·m per unit of each parameter.
    """
    q, dq, ddq = (np.asarray(x, dtype=float) for x in (q, dq, ddq))
    result = np.empty((len(q), body.n, 10 * body.n))
    for rows, block in regressor_blocks(body, q, dq, ddq):
        result[rows] = block.transpose(2, 0, 1)
    return result


def inverse_dynamics(body: RigidBody, parameters: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """Torques (samples, n) of inertial parameters (10·n,), physically possible or not."""
    q, dq, ddq = (np.asarray(x, dtype=float) for x in (q, dq, ddq))
    tau = np.empty((len(q), body.n))
    for rows, block in regressor_blocks(body, q, dq, ddq):
        tau[rows] = np.einsum("ips,p->si", block, parameters)
    return tau


def inverse_dynamics_slopes(body: RigidBody, parameters: Array, q: Array, dq: Array, ddq: Array) -> Array:
    """(3, samples, n, n): how the torques of `inverse_dynamics` follow each joint's angle, velocity and acceleration
    (last index), N·m per rad, rad/s, rad/s².

    Differences: exact in acceleration (linear) and velocity (quadratic), to some 1e-9 in the angle.
    """
    result = np.empty((3, len(q), body.n, body.n))
    for order, step in enumerate((1e-5, 1.0, 1.0)):
        for joint in range(body.n):
            shift = np.zeros((3, body.n))
            shift[order, joint] = step
            ahead, behind = (
                inverse_dynamics(body, parameters, q + s * shift[0], dq + s * shift[1], ddq + s * shift[2])
                for s in (1.0, -1.0)
            )
            result[order, :, :, joint] = (ahead - behind) / (2.0 * step)
    return result


def regressor_blocks(
    body: RigidBody, q: Array, dq: Array, ddq: Array, block: int = BLOCK
) -> Iterator[tuple[slice, Array]]:
    """Regressor block by block: (rows, K) with K (n, 10·n, samples of the block).

    K is overwritten by the next block; memory does not grow with the recording.
    """
    buffer = np.zeros((body.n, 10 * body.n, min(block, max(len(q), 1))))
    for start in range(0, len(q), block):
        rows = slice(start, min(start + block, len(q)))
        view = buffer[:, :, : rows.stop - rows.start]
        fill_regressor(body, q[rows].T, dq[rows].T, ddq[rows].T, view)
        yield rows, view


def fill_regressor(body: RigidBody, q: Array, dq: Array, ddq: Array, out: Array) -> None:
    """One block: joints × samples in, ``out`` (n, 10·n, samples); entries of K that are always zero are left alone."""
    samples = q.shape[1]
    states: list[_LinkState] = []
    for link, axis in enumerate(body.axes):
        parent = states[axis.parent] if axis.parent >= 0 else _base(body, samples)
        state = _step(body, link, parent, q[link], dq[link], ddq[link])
        states.append(state)
        joints = list(body.ancestors(link))
        columns = slice(10 * link, 10 * link + 10)
        if joints == list(range(link + 1)):
            _project(state, out[: link + 1, columns])
        else:
            rows = np.empty((len(joints), 10, samples))
            _project(state, rows)
            out[joints, columns] = rows


class _LinkState:
    """Motion of one link's frame, and the screws of its ancestors, all in that frame.

    ``w`` angular velocity, ``dw`` angular acceleration, ``a`` acceleration of the origin less gravity: (3, samples).
    ``turn``, ``slide``: (ancestors, 3, samples), what a unit velocity of each ancestor does to frame and origin.
    """

    __slots__ = ("a", "dw", "slide", "turn", "w")

    def __init__(self, w: Array, dw: Array, a: Array, turn: Array, slide: Array) -> None:
        self.w, self.dw, self.a, self.turn, self.slide = w, dw, a, turn, slide


def _base(body: RigidBody, samples: int) -> _LinkState:
    still = np.zeros((3, samples))
    none = np.zeros((0, 3, samples))
    return _LinkState(still, still, np.repeat(-body.gravity[:, None], samples, axis=1), none, none)


def _step(body: RigidBody, link: int, parent: _LinkState, q: Array, dq: Array, ddq: Array) -> _LinkState:
    """Outward recursion (Luh, Walker, Paul 1980) over one joint."""
    axis = body.axes[link]
    direction = axis.direction
    if axis.revolute:
        entries = _rotation_entries(axis.rotation, direction, q)
        arm: list[float | Array] = list(axis.translation)
    else:
        entries = [[float(x) for x in row] for row in axis.rotation]
        along = axis.rotation @ direction
        arm = [axis.translation[k] + along[k] * q for k in range(3)]
    w = _into(entries, parent.w)
    dw = _into(entries, parent.dw)
    # acceleration of the child's origin, still in the parent's frame
    a = parent.a + _cross(parent.dw, arm) + _cross(parent.w, list(_cross(parent.w, arm)))
    a = _into(entries, a)
    count = parent.turn.shape[0]
    turn = np.zeros((count + 1, 3, q.shape[0]))
    slide = np.zeros((count + 1, 3, q.shape[0]))
    if count:
        _into(entries, parent.turn, turn[:count])
        _into(entries, parent.slide + _cross(parent.turn, arm), slide[:count])
    own = turn if axis.revolute else slide
    own[count] = direction[:, None]
    spin = _cross(w, list(direction * 1.0))
    if axis.revolute:
        dw = dw + spin * dq + direction[:, None] * ddq
        w = w + direction[:, None] * dq
    else:
        a = a + 2.0 * spin * dq + direction[:, None] * ddq
    return _LinkState(w, dw, a, turn, slide)


def _rotation_entries(rotation: Array, direction: Array, q: Array) -> list[list[float | Array]]:
    """rotation · exp([direction×]·q) (Rodrigues): numbers where an entry does not depend on q, arrays where it does."""
    x, y, z = direction
    skew = np.array([[0.0, -z, y], [z, 0.0, -x], [-y, x, 0.0]])
    constant, cosine, sine = rotation @ (np.eye(3) + skew @ skew), -rotation @ skew @ skew, rotation @ skew
    c, s = np.cos(q), np.sin(q)
    tiny = 1e-15

    def entry(i: int, j: int) -> float | Array:
        value: float | Array = float(constant[i, j]) if abs(constant[i, j]) > tiny else 0.0
        for factor, wave in ((cosine[i, j], c), (sine[i, j], s)):
            if abs(factor) > tiny:
                value = value + factor * wave
        return value

    return [[entry(i, j) for j in range(3)] for i in range(3)]


def _absent(x: float | Array) -> bool:
    return isinstance(x, float) and x == 0.0


def _into(entries: list[list[float | Array]], x: Array, out: Array | None = None) -> Array:
    """Rᵀ·x for vectors (…, 3, samples); entries that are zero cost nothing."""
    result = np.zeros_like(x) if out is None else out
    for k in range(3):
        first = True
        for c in range(3):
            if _absent(entries[c][k]):
                continue
            if first:
                np.multiply(x[..., c, :], entries[c][k], out=result[..., k, :])
                first = False
            else:
                result[..., k, :] += x[..., c, :] * entries[c][k]
        if first:
            result[..., k, :] = 0.0
    return result


def _cross(x: Array, p: list[float | Array]) -> Array:
    """x × p for vectors x (…, 3, samples) and p three numbers or arrays over the samples."""
    result = np.zeros_like(x)
    for k in range(3):
        i, j = (k + 1) % 3, (k + 2) % 3
        if not _absent(p[j]):
            np.multiply(x[..., i, :], p[j], out=result[..., k, :])
        if not _absent(p[i]):
            result[..., k, :] -= x[..., j, :] * p[i]
    return result


def _project(state: _LinkState, out: Array) -> None:
    """Power of the link's ten unit wrenches (Eq. 4.1) on each ancestor's unit motion: out (ancestors, 10, samples)."""
    w, dw, a, turn, slide = state.w, state.dw, state.a, state.turn, state.slide
    wx, wy, wz = w
    dx, dy, dz = dw
    ax, ay, az = a
    xx, yy, zz, xy, xz, yz = wx * wx, wy * wy, wz * wz, wx * wy, wx * wz, wy * wz
    # force by the first moment: [dw×] + [w×][w×]
    force = np.array(
        [
            [-yy - zz, xy - dz, xz + dy],
            [xy + dz, -xx - zz, yz - dx],
            [xz - dy, yz + dx, -xx - yy],
        ]
    )
    # moment about the origin by the inertia: [•dw] + [w×][•w], rows x y z, columns Ixx Ixy Ixz Iyy Iyz Izz
    zero = np.zeros_like(wx)
    moment = np.array(
        [
            [dx, dy - xz, dz + xy, -yz, yy - zz, yz],
            [xz, dx + yz, zz - xx, dy, dz - xy, -xz],
            [-xy, xx - yy, dx - yz, xy, dy + xz, dz],
        ]
    )
    # moment about the origin by the first moment: c × a
    lever = np.array([[zero, az, -ay], [-az, zero, ax], [ay, -ax, zero]])
    np.einsum("ecs,cs->es", slide, a, out=out[:, 0])
    np.einsum("ecs,cks->eks", slide, force, out=out[:, 1:4])
    out[:, 1:4] += np.einsum("ecs,cks->eks", turn, lever)
    np.einsum("ecs,cks->eks", turn, moment, out=out[:, 4:10])
