"""Units by what the channels say of each other, and of the URDF's masses and limits."""

from __future__ import annotations

from collections.abc import Mapping, Sequence

import numpy as np
from numpy.typing import NDArray

from estimator.convolution import convolve
from estimator.filtering import plan_filter, resample
from estimator.plausibility.coarse import coarse
from estimator.plausibility.doubt import Doubt, times
from estimator.plausibility.snapshot import Snapshot
from estimator.regressor import inverse_dynamics
from estimator.rigid_body import RigidBody
from estimator.rows import CHUNK
from estimator.trajectory import Trajectory

Array = NDArray[np.float64]

_DEGREES = 180.0 / np.pi
_ABOUT = 0.15
"""Share by which a ratio of channels may miss 57.3 and still mean degrees."""
_RPM = 30.0 / np.pi
_SAID = {
    _RPM: f"{_RPM:.2f}: revolutions a minute",
    _DEGREES: f"{_DEGREES:.1f}: degrees/s",
    1.0 / _DEGREES: f"one over {_DEGREES:.1f}: the angle is in degrees",
    2.0 * np.pi: f"{2.0 * np.pi:.2f}: the angle is in turns",
}
_GAIN = 2.0
"""Times that a velocity may differ from its angle's derivative and still be a sensor of wrong gain."""
_BAND = 0.5
_ALIKE = 0.8
"""Least correlation of two channels to compare their sizes: a torque with that of the URDF's masses, beside friction; a
velocity with its angle's derivative."""
_SAME, _UNLIKE = 0.95, 0.9
"""Correlations of a velocity with the derivative of another joint's angle, and with its own, to be that joint's."""
_MATTERS = 0.1
"""Of the largest joint's: a model torque below is friction's prey."""
_MOST = 0.5
"""Share of the model torques' energy that the compared joints must have."""
_DOUBTFUL, _IMPOSSIBLE = 5.0, 20.0
"""Times that masses in a URDF are off. Rough CAD is off by two, amperes and millinewtons by far more."""
_ALL_ALIKE = 0.1
"""Share by which joints' ratios differ that are all off by one unit: right recordings of arms whose links are known to
5 % differ so much."""
_NOTICED, _NO_LOAD, _NO_LOAD_OF_TWO = 1.2, 1.8, 2.5
"""Times off: to be said; and to be wrong, on three joints and more, or on two. A gripper that the URDF lacks makes the
torques of two joints 1.55 times as large (the Kinova of ../shared/data)."""
_NEAR = 0.05
_POUNDS = 0.7376
"""lbf·ft a N·m: so much smaller no load makes the torques of three joints."""
_KNOWN = {
    _POUNDS: "in lbf·ft",
    1.0 / 2.2046: "of masses in lb",
    2.2046: "of masses in lb",
    2.0**0.5: "by peak currents",
}
"""By the size of the torques over those of the URDF what either may be told in."""
_TOO_FAST = 5.0
"""Times a URDF's velocity limit."""


def velocity_against_angle(body: RigidBody, trajectories: Sequence[Trajectory]) -> list[Doubt]:
    """Velocities that are no derivative of the angles: in degrees, or of the other sign or another unit at a joint."""
    ratios: list[list[float]] = [[] for _ in range(body.n)]
    another: dict[int, int] = {}
    for trajectory in map(coarse, trajectories):
        piece = next(trajectory.segments(CHUNK, 0), None)
        plan = plan_filter(trajectory.rate, _BAND)
        if trajectory.dq is None or piece is None or len(piece) <= 2 * plan.edge + 1:
            continue
        t = trajectory.t[piece]
        slope = convolve(resample(t, trajectory.q[piece], plan.rate), plan.slope)
        measured = convolve(resample(t, trajectory.dq[piece], plan.rate), plan.smooth)
        power = np.sum(slope**2, axis=0)
        both = np.sum(slope * measured, axis=0)
        alike = np.abs(both) > _ALIKE * np.sqrt(power * np.sum(measured**2, axis=0))
        another |= _of_another(slope, measured)
        for joint in np.flatnonzero((power > 1e-4 * power.max(initial=0.0)) & alike):
            ratios[joint].append(float(both[joint] / power[joint]))
    if another:
        return [_velocities_exchanged(body, another)]
    found = {joint: float(np.median(values)) for joint, values in enumerate(ratios) if values}
    turning = {joint: ratio for joint, ratio in found.items() if body.axes[joint].revolute}
    return _degrees(body, list(turning.values())) or _no_derivative(body, found)


def _of_another(slope: Array, measured: Array) -> dict[int, int]:
    """By joint whose velocity (samples, n) is not its angle's derivative, the joint whose derivative it is."""
    lengths = np.linalg.norm(slope, axis=0)[:, None] * np.linalg.norm(measured, axis=0)
    with np.errstate(divide="ignore", invalid="ignore"):
        alike = np.where(lengths > 0.0, slope.T @ measured / lengths, 0.0)
    nearest = np.argmax(np.abs(alike), axis=0)
    own = np.abs(np.diag(alike))
    return {
        joint: other
        for joint, other in enumerate(nearest.tolist())
        if own[joint] < _UNLIKE and abs(alike[other, joint]) > _SAME
    }


def _velocities_exchanged(body: RigidBody, another: Mapping[int, int]) -> Doubt:
    names = body.joints
    listed = ", ".join(f"{names[joint]} of {names[other]}" for joint, other in another.items())
    problem = f"velocities are out of order: they are the derivatives of other joints' angles ({listed})"
    joints = tuple(names[joint] for joint in another)
    return Doubt("velocity order", joints, problem, "put the velocities in the order of the angles", _SAME, True)


def _degrees(body: RigidBody, ratios: Sequence[float]) -> list[Doubt]:
    """In the median over turning joints."""
    if not ratios:
        return []
    ratio = float(np.median(ratios))
    joints = tuple(name for name, axis in zip(body.joints, body.axes, strict=True) if axis.revolute)
    if abs(ratio / _DEGREES - 1.0) < _ABOUT:
        problem = f"the velocities are {ratio:.1f} times the derivative of the angles: they are in degrees/s"
        return [Doubt("velocities in degrees", joints, problem, "convert them to rad/s", ratio, True)]
    if abs(ratio * _DEGREES - 1.0) < _ABOUT:
        problem = f"the derivative of the angles is {1.0 / ratio:.1f} times the velocities: the angles are in degrees"
        return [Doubt("angles in degrees", joints, problem, "convert them to rad", ratio, True)]
    return []


def _no_derivative(body: RigidBody, ratios: Mapping[int, float]) -> list[Doubt]:
    """Joint by joint. What goes with the angle's derivative and is not half or twice of it yet is a sensor's gain."""
    turned = {joint: ratio for joint, ratio in ratios.items() if ratio < 0.0}
    scaled = {joint: ratio for joint, ratio in ratios.items() if not 1.0 / _GAIN < abs(ratio) < _GAIN}
    for kind, wrong in (("velocity scale", scaled), ("velocity sign", turned)):
        if not wrong:
            continue
        names = tuple(body.joints[joint] for joint in wrong)
        ratio = float(np.median(list(wrong.values())))
        if kind == "velocity sign":
            problem = f"the velocity of {', '.join(names)} runs against its angle: one of the two has the wrong sign"
            return [Doubt("velocity sign", names, problem, "turn the sign of the velocity", ratio, True)]
        said = next((f" ({unit})" for size, unit in _SAID.items() if abs(abs(ratio) / size - 1.0) < _ABOUT), "")
        problem = f"the velocity of {', '.join(names)} is {times(ratio)} times the derivative of its angle{said}"
        return [Doubt("velocity scale", names, problem, "convert both to rad and rad/s (m and m/s)", ratio, True)]
    return []


def speed_against_limits(body: RigidBody, shot: Snapshot) -> list[Doubt]:
    """Speeds far beyond the URDF's limits on most turning joints, which as degrees/s would keep them."""
    limits = np.asarray(body.model.velocityLimit, dtype=float)
    turning = np.array([axis.revolute for axis in body.axes]) & (limits > 0.0) & np.isfinite(limits)
    if not turning.any():
        return []
    share = (np.abs(shot.dq).max(axis=0) / np.where(limits > 0.0, limits, np.inf))[turning]
    fastest = float(share.max())
    if np.median(share) > _TOO_FAST and fastest < _DEGREES:
        joints = tuple(np.array(body.joints)[turning].tolist())
        problem = f"the joints move at up to {fastest:.0f} times the URDF's velocity limits: the angles are in degrees"
        return [Doubt("angles in degrees", joints, problem, "convert them to rad", fastest, True)]
    return []


def torque_against_masses(body: RigidBody, shot: Snapshot) -> list[Doubt]:
    """Torques of another size or sign than the URDF's masses call for. Nothing where the URDF has none."""
    prior = body.prior()
    if not np.any(prior[::10] > 0.0):
        return []
    scale = _scales(inverse_dynamics(body, prior, shot.q, shot.dq, shot.ddq), shot)
    if not scale:
        return []
    sizes = np.sort(np.abs(list(scale.values())))
    # Of the two in the middle the one nearer to one: a single joint in another unit is not all of them.
    middle = sizes[(len(sizes) - 1) // 2], sizes[len(sizes) // 2]
    size = float(min(middle, key=lambda ratio: abs(np.log(max(ratio, 1e-12)))))
    joints = tuple(body.joints[j] for j in scale)
    doubts: list[Doubt] = []
    if size > _DOUBTFUL or size < 1.0 / _DOUBTFUL:
        units = (
            "mA, mN·m, kgf·cm, A of a motor without gear, or a raw count"
            if size > 1.0
            else "A, kgf·m, a share of the rated torque, or torques on the motor's side of the gear"
        )
        problem = f"the torques are {times(size)} times those of the URDF's masses: they may be {units}"
        remedy = "convert them to N·m at the joint (torque constant and gear ratio)"
        certain = size > _IMPOSSIBLE or size < 1.0 / _IMPOSSIBLE
        doubts.append(Doubt("torque scale", joints, problem, remedy, size, certain))
    if all(value < 0.0 for value in scale.values()):
        problem = f"the torques of {', '.join(joints)} have the other sign than the URDF's masses call for"
        remedy = "turn the torques' sign, or the direction of gravity"
        doubts.append(Doubt("torque sign", joints, problem, remedy, -size, True))
    return doubts


def torques_alike(body: RigidBody, shot: Snapshot) -> list[Doubt]:
    """Torques that are off from those of the URDF's masses by one factor at every joint where the two are seen: no
    load and no friction does that."""
    scale = sizes_of_torques(body, shot)
    sizes = np.array(list(scale.values()))
    if len(sizes) < 2:
        return []
    size = float(np.exp(np.mean(np.log(sizes))))
    off = max(size, 1.0 / max(size, 1e-12))
    # Two joints a load may make alike, and larger; none makes torques smaller.
    least, most = (_NO_LOAD, _NO_LOAD_OF_TWO) if len(sizes) == 2 and size > 1.0 else (_NOTICED, _NO_LOAD)
    if off < least or np.max(np.abs(sizes / size - 1.0)) > _ALL_ALIKE:
        return []
    joints = tuple(body.joints[joint] for joint in scale)
    known = next((f": {what}, perhaps" for ratio, what in _KNOWN.items() if abs(size / ratio - 1.0) < _NEAR), "")
    problem = f"the torques of {', '.join(joints)} are alike {times(size)} times those of the URDF's masses{known}"
    remedy = "check the unit of both: N·m at the joint, and kg"
    pounds = len(sizes) > 2 and abs(size / _POUNDS - 1.0) < _NEAR
    return [Doubt("torque scale", joints, problem, remedy, size, off > most or pounds)]


def sizes_of_torques(body: RigidBody, shot: Snapshot) -> dict[int, float]:
    """By joint: the size of the measured torque over that of the given links, where the two go together."""
    model = inverse_dynamics(body, body.prior(), shot.q, shot.dq, shot.ddq)
    return {joint: abs(ratio) for joint, ratio in _ratios(model, shot).items()}


def _scales(model: Array, shot: Snapshot) -> dict[int, float]:
    """`_ratios` where the joints that have one carry most of what is expected; nothing otherwise."""
    result = _ratios(model, shot)
    sizes = np.mean(model**2, axis=0)
    return result if float(np.sum(sizes[list(result)])) > _MOST * float(np.sum(sizes)) else {}


def _ratios(model: Array, shot: Snapshot) -> dict[int, float]:
    """Measured over model torque, by joint, where they go together once friction and offset are set aside."""
    result: dict[int, float] = {}
    sizes = np.sqrt(np.mean(model**2, axis=0))
    for joint in np.flatnonzero(sizes > _MATTERS * sizes.max()).tolist():
        dq = shot.dq[:, joint]
        beside = np.column_stack([np.ones_like(dq), dq, np.tanh(dq / 0.02)])
        pair = np.column_stack([model[:, joint], shot.tau[:, joint]])[shot.usable[:, joint]]
        beside = beside[shot.usable[:, joint]]
        if len(pair) < 20:
            continue
        x, y = (pair - beside @ np.linalg.lstsq(beside, pair, rcond=None)[0]).T
        length = float(np.linalg.norm(x) * np.linalg.norm(y))
        if not (length > 0.0 and abs(x @ y) > _ALIKE * length):
            continue
        # A load that the URDF does not know may outweigh what moves, but not the weight that is carried as well.
        moved, carried = float(x @ y / (x @ x)), float(pair[:, 0] @ pair[:, 1] / (pair[:, 0] @ pair[:, 0]))
        if moved * carried > 0.0:
            result[joint] = min(moved, carried, key=lambda ratio: abs(np.log(abs(ratio))))
    return result
