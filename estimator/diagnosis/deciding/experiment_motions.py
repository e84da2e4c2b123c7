"""The family of motions from which a deciding one is chosen: each within an arm's limits, from rest to rest."""

from __future__ import annotations

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from config.motion.curves import RestToRest, Spline
from estimator.excitation.limits import MotionLimits
from estimator.rigid_body import RigidBody

Array = NDArray[np.float64]

POINTS_HZ = 100.0
"""Points a second of a motion's path; a spline goes through them."""
_USED = 0.85
"""Share of the limits that a motion may use: torques differ from the model's, and a servo needs some."""
_REST_S = 0.3
_BLEND_S = 0.2
"""Over which a speed changes."""
_SPEEDS = 6
_AMPLITUDES = (0.004, 0.012, 0.04)
"""rad of micro-reversals."""
_POSES = 12
"""At most, in a grid of poses …"""
_DWELL_S, _LEAST_MOVE_S = 0.7, 0.8
"""… of rests this long, and moves at least so long."""
_SHRINK = 0.8
_SMALLEST = 0.1
"""Of the amplitude that range, speed and acceleration allow: what torque or floor does not allow at this is dropped."""


@dataclass(frozen=True)
class ExperimentMotion:
    """A path: ``points`` (k, n) rad at ``t`` (k,) s, at rest at both ends. ``kind`` in words, ``joints`` that move."""

    kind: str
    joints: tuple[int, ...]
    t: Array
    points: Array

    def sampled(self, rate_hz: float) -> tuple[Array, Array, Array, Array]:
        """t (samples,), and q, dq, ddq (samples, n)."""
        t = np.arange(int(self.t[-1] * rate_hz) + 1) / rate_hz
        return (t, *Spline(self.t, self.points).evaluate(t))


def family(
    body: RigidBody,
    limits: MotionLimits,
    home: Array,
    joints: Sequence[int],
    band: float,
    seconds: float = 15.0,
    seed: int = 0,
) -> Iterator[ExperimentMotion]:
    """Motions of each of ``joints`` alone (slow sweep, constant speeds, ramps from rest, micro-reversals, chirp to
    ``band`` Hz) at home and at a seeded pose, and of all joints together (rests in a grid of poses, harmonics), about
    ``seconds`` long. What the limits do not allow even when it is small is left out.
    """
    random = np.random.default_rng(seed)
    middle, half = (limits.upper + limits.lower) / 2.0, (limits.upper - limits.lower) / 2.0
    poses = [
        np.clip(home, middle - 0.7 * half, middle + 0.7 * half),
        middle + 0.6 * half * random.uniform(-1, 1, body.n),
    ]
    for joint in joints:
        for pose in poses:
            for kind, t, offset in _alone(limits, pose, joint, band, seconds):
                points = np.tile(pose, (len(t), 1))
                points[:, joint] += offset
                motion = _within(body, limits, pose, ExperimentMotion(kind, (joint,), t, points))
                if motion is not None:
                    yield motion
    everywhere = tuple(range(body.n))
    for kind, t, points in _together(limits, middle, half, seconds, random):
        motion = _within(body, limits, points[0], ExperimentMotion(kind, everywhere, t, points))
        if motion is not None:
            yield motion


def _alone(
    limits: MotionLimits, pose: Array, joint: int, band: float, seconds: float
) -> Iterator[tuple[str, Array, Array]]:
    """Kind, times, and the joint's way from the pose."""
    low, high = limits.lower[joint] - pose[joint], limits.upper[joint] - pose[joint]
    room = _USED * min(-low, high)
    fastest, hardest = _USED * limits.velocity[joint], _USED * limits.acceleration[joint]
    sweep = min(4.0 * room / seconds, fastest)
    yield "slow sweep", *_by_speeds([(sweep, room / sweep), (-sweep, 2.0 * room / sweep), (sweep, room / sweep)])
    # Each speed for as long as its share of the time or the room allows, there and back.
    top = min(0.7 * fastest, hardest * _BLEND_S, 2.0 * room)
    speeds = np.geomspace(0.02 * top, top, _SPEEDS)
    each = seconds / (2.0 * _SPEEDS)
    legs = [(sign * v, min(each, 0.9 * room / v)) for v in speeds for sign in (1.0, -1.0)]
    yield "constant speeds", *_by_speeds(legs)
    yield "ramps from rest", *_ramps(0.3 * top, room, seconds)
    amplitudes = [a for a in _AMPLITUDES if a < room]
    strokes = [(a, a / duration) for a in amplitudes for duration in (0.25, 0.5, 1.0)]
    again = max(1, round(seconds / sum(2.0 * a / v for a, v in strokes)))
    legs = [(sign * v, a / v) for a, v in strokes for sign in (1.0, -1.0)] * again
    yield "micro-reversals", *_by_speeds(legs, blend=0.1)
    yield "chirp", *_chirp(room, fastest, hardest, 0.4 * band, seconds)


def _by_speeds(legs: Sequence[tuple[float, float]], blend: float = _BLEND_S) -> tuple[Array, Array]:
    """Times and way at these speeds (rad/s), each for so many seconds, blended over ``blend`` s, rest around them."""
    rest = round((_REST_S + blend) * POINTS_HZ)
    counts = [max(2, round(duration * POINTS_HZ)) for _, duration in legs]
    # Whole samples for the same way: speeds are adapted, so that there and back remain the same.
    speed = np.concatenate(
        [np.zeros(rest), *(np.full(n, v * d * POINTS_HZ / n) for n, (v, d) in zip(counts, legs, strict=True))]
        + [np.zeros(rest)]
    )
    return _integrated(speed, blend)


def _ramps(top: float, room: float, seconds: float) -> tuple[Array, Array]:
    """Times and way of speeds that rise from rest to ``top`` and fall again, both ways."""
    each = min(seconds / 4.0, 1.8 * room / top)
    count = round(each * POINTS_HZ)
    ramp = top * (1.0 - np.abs(np.linspace(-1.0, 1.0, count)))
    rest = np.zeros(round(_REST_S * POINTS_HZ))
    again = max(1, round(seconds / (2.0 * (each + _REST_S))))
    return _integrated(np.concatenate([rest, *([ramp, rest, -ramp, rest] * again)]), _BLEND_S)


def _integrated(speed: Array, blend: float) -> tuple[Array, Array]:
    window = np.hanning(max(3, round(blend * POINTS_HZ)) + 2)
    smooth = np.convolve(speed, window / window.sum(), mode="same")
    t = np.arange(len(speed)) / POINTS_HZ
    way = np.concatenate([[0.0], np.cumsum((smooth[1:] + smooth[:-1]) / (2.0 * POINTS_HZ))])
    return t, way


def _chirp(room: float, fastest: float, hardest: float, top_hz: float, seconds: float) -> tuple[Array, Array]:
    """From a fifth of a hertz upwards, as large at every frequency as the limits allow."""
    t = np.arange(round(seconds * POINTS_HZ)) / POINTS_HZ
    frequency = np.geomspace(0.2, max(top_hz, 1.0), len(t))
    w = 2.0 * np.pi * frequency
    phase = np.cumsum(w) / POINTS_HZ
    amplitude = 0.7 * np.minimum(np.minimum(room, fastest / w), hardest / w**2)
    fade = np.clip(np.minimum(t, t[-1] - t) / 1.0, 0.0, 1.0)
    return t, amplitude * np.sin(phase) * fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2)


def _together(
    limits: MotionLimits, middle: Array, half: Array, seconds: float, random: np.random.Generator
) -> Iterator[tuple[str, Array, Array]]:
    """Kind, times and points of motions of all joints."""
    for _ in range(2):
        poses = middle + _USED * half * random.uniform(-1.0, 1.0, (_POSES, len(middle)))
        moves = np.abs(np.diff(poses, axis=0))
        speed = np.max(moves * 15.0 / 8.0 / limits.velocity, axis=1) / _USED
        bend = np.sqrt(np.max(moves * 10.0 / 3.0**0.5 / limits.acceleration, axis=1) / _USED)
        each = np.maximum(np.maximum(speed, bend), _LEAST_MOVE_S)
        count = max(1, int(np.searchsorted(np.cumsum(each + _DWELL_S), seconds)))
        curve = RestToRest(poses[: count + 1], each[:count].tolist(), 5, _DWELL_S)
        t = np.arange(int(curve.duration_s * POINTS_HZ) + 1) / POINTS_HZ
        yield "rests in a grid of poses", t, curve.evaluate(t)[0]
    for base_hz in (0.1, 0.1, 0.3):
        t = np.arange(round(seconds * POINTS_HZ)) / POINTS_HZ
        w = 2.0 * np.pi * base_hz * np.arange(1, 6)
        shape = random.normal(size=(2, 5, len(middle))) / np.arange(1, 6)[:, None]
        path = np.sin(np.outer(t, w)) @ shape[0] + np.cos(np.outer(t, w)) @ shape[1]
        fade = np.clip(np.minimum(t, t[-1] - t) / 2.0, 0.0, 1.0)[:, None]
        path *= fade**3 * (10.0 - 15.0 * fade + 6.0 * fade**2)
        q, dq, ddq = Spline(t, path).evaluate(t)
        uses = [np.abs(q).max(0) / half, np.abs(dq).max(0) / limits.velocity, np.abs(ddq).max(0) / limits.acceleration]
        yield "harmonics of all joints", t, middle + _USED * path / np.max(uses, axis=0)


def _within(body: RigidBody, limits: MotionLimits, pose: Array, motion: ExperimentMotion) -> ExperimentMotion | None:
    """The motion, made smaller about its pose until all limits hold; None when it does not become possible."""
    size = 1.0
    while size >= _SMALLEST:
        trial = replace(motion, points=pose + size * (motion.points - pose))
        if _use(body, limits, trial) <= 1.0:
            return trial
        size *= _SHRINK
    return None


def _use(body: RigidBody, limits: MotionLimits, motion: ExperimentMotion) -> float:
    """The largest use of any limit, some of each left to what the model does not know."""
    _, q, dq, ddq = motion.sampled(2.0 * POINTS_HZ)
    tighter = replace(
        limits,
        velocity=0.95 * limits.velocity,
        acceleration=0.95 * limits.acceleration,
        torque=None,
        parameters=None,
        floor=None,
    )
    use = tighter.worst(body, q, dq, ddq)
    if use > 1.0 or (limits.torque is None and limits.floor is None):
        return use
    thin = slice(None, None, 10)
    return max(use, limits.worst(body, q[thin], dq[thin], ddq[thin]))
